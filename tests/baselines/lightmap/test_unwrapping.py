"""Every triangle has a place of its own in the atlas, and a lookup there reads its own chart alone."""

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest
import trimesh

from gibench.baselines.lightmap.coverage import cover
from gibench.baselines.lightmap.filling import dilate, fill_charts
from gibench.baselines.lightmap.lookup import Lightmap
from gibench.baselines.lightmap.texel_paths import TexelPoints
from gibench.baselines.lightmap.unwrapping import NONE, LightmapError, densities, unwrap
from gibench.generators.rooms import sample_room
from gibench.generators.scene_files import write_room
from gibench.rendering.scene import load_dict, load_scene
from tests.baselines.meshes import diffuse, ply, room, slab
from tests.rendering import scenes


@pytest.fixture(scope="module")
def furnished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("room")
    write_room(sample_room(3, 0), folder)
    return load_scene(folder / "scene.xml")


def atlas_of(unwrapping, coverage):
    """(H, W) numbers of charts, −1 off all of them."""
    width, height = unwrapping.size
    charts = np.full(width * height, -1, dtype=np.int32)
    charts[coverage.texels] = coverage.charts
    return charts.reshape(height, width)


def test_a_lookup_reads_its_own_chart_alone(furnished):
    """Each chart is painted in its number; 200,000 places all over a furnished room must read it back."""
    unwrapping = unwrap(furnished, 16)
    charts = atlas_of(unwrapping, cover(unwrapping, 2))
    painted = np.repeat(charts[..., None], 3, axis=-1).astype(np.float32)
    painted[charts < 0] = np.nan
    lightmap = Lightmap(furnished, dilate(painted, charts), unwrapping.corners, unwrapping.offsets)
    rng = np.random.default_rng(0)
    faces = np.flatnonzero(unwrapping.charts >= 0)
    faces = np.concatenate([faces, rng.choice(faces, 200_000)]).astype(np.int32)
    weights = rng.dirichlet((0.4, 0.4, 0.4), len(faces)).astype(np.float32)
    # Corners and edges, where a lookup reaches farthest out of its chart.
    weights[: len(weights) // 4] = np.eye(3, dtype=np.float32)[rng.integers(3, size=len(weights) // 4)]
    places = replace(cover(unwrapping, 2), faces=faces, barycentrics=weights[:, 1:])
    points = TexelPoints(furnished, unwrapping, places)
    lane = mi.UInt32(np.arange(len(faces)))
    read = np.array(lightmap.irradiance(points.interaction(lane), points.preliminary(lane)).x)
    np.testing.assert_allclose(read, unwrapping.charts[faces], rtol=1e-5, atol=1e-3)


def test_texels_hold_points_of_their_own(furnished):
    """Points of the grid lie in their texel; one that stands in for them is as near as a chart that touches it."""
    unwrapping = unwrap(furnished, 8)
    coverage = cover(unwrapping, 4)
    counts = np.diff(coverage.first)
    assert counts.min() >= 1
    assert counts.max() == 16
    texel = np.repeat(coverage.texels, counts)
    corner = np.stack([texel % unwrapping.size[0], texel // unwrapping.size[0]], axis=-1)
    triangles = unwrapping.corners[coverage.faces].astype(np.float64)
    weights = np.column_stack([1 - coverage.barycentrics.sum(axis=1), coverage.barycentrics]).astype(
        np.float64
    )
    assert weights.min() > -1e-3
    at = np.einsum("nc,ncd->nd", weights, triangles)
    offset, alone = at - corner - 0.5, np.repeat(counts, counts) == 1
    assert np.abs(offset[~alone]).max() < 0.5 + 2e-3
    assert np.linalg.norm(offset[alone], axis=1).max() < np.sqrt(0.5) + 2e-3


def test_texels_follow_the_density(furnished):
    """Four times as many texels at twice the density, but for seams; as many as the area says, but for their rims."""
    area = {density: len(cover(unwrap(furnished, density), 1).texels) for density in (16, 32)}
    assert 2.5 < area[32] / area[16] < 4.2


def test_density_of_the_tiny_and_the_huge():
    found = densities(np.array([1e-4, 1.0, 4e6]), 16)
    assert found[0] == pytest.approx(8 / 1e-2)  # 8 × 8 texels
    assert found[1] == 16
    assert found[2] == pytest.approx(16 * 8 / 2000)  # 128 × 128
    many = densities(np.full(10_000, 1.0), 64)
    assert np.sum(many**2) == pytest.approx(1 << 24)


def test_degenerate_triangles_have_a_place(tmp_path):
    """Slivers without area sit where a neighbour does; the others keep their order."""
    sphere = trimesh.creation.icosphere(subdivisions=2)
    faces = sphere.faces.copy()
    collapsed = np.array([[0, 0, 1], [5, 5, 5], [7, 8, 8]])
    mesh = trimesh.Trimesh(sphere.vertices, np.concatenate([collapsed, faces]), process=False)
    scene = load_dict({"type": "scene", "ball": ply(mesh, tmp_path / "ball.ply", diffuse(0.5))})
    unwrapping = unwrap(scene, 8)
    assert len(unwrapping.corners) == len(faces) + 3
    assert np.isfinite(unwrapping.corners).all()
    assert (unwrapping.charts >= 0).all()
    assert set(unwrapping.charts[:3]) <= set(unwrapping.charts[3:])
    coverage = cover(unwrapping, 4)
    assert set(coverage.faces) - {0, 1, 2} >= set(range(3, len(mesh.faces)))


def test_a_mesh_without_any_area(tmp_path):
    mesh = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], process=False)
    scene = load_dict(
        {"type": "scene", "line": ply(mesh, tmp_path / "line.ply", diffuse(0.5)), **room(diffuse(0.5))}
    )
    unwrapping = unwrap(scene, 8)
    assert unwrapping.charts[int(unwrapping.offsets[1])] == -1
    assert len(cover(unwrapping, 2).texels) > 0


def test_what_is_left_out():
    """Mirrors and lamps have no texels; a diffuse sphere that does not shine is refused by name."""
    description = {
        "type": "scene",
        **room(diffuse(0.5)),
        "mirror": slab([-0.2] * 3, [0.2] * 3, scenes.MATERIALS["mirror"]),
        "bulb": {
            "type": "sphere",
            "radius": 0.1,
            "center": [0, 0, 0.8],
            "bsdf": diffuse(0.6),
            "e": scenes.area(9),
        },
    }
    scene = load_dict(description)
    offsets = dict(zip(scene.shapes, unwrap(scene, 4).offsets[1:], strict=True))
    assert offsets["mirror"] == offsets["bulb"] == NONE
    assert all(offsets[name] != NONE for name in offsets if name.startswith("wall"))
    del description["bulb"]["e"]
    with pytest.raises(LightmapError, match="bulb"):
        unwrap(load_dict(description), 4)


def test_filling_stays_on_its_chart():
    charts = np.array([[0, 0, 0, 1, 1], [0, 0, 0, 1, 1]])
    atlas = np.zeros((2, 5, 3), dtype=np.float32)
    known = np.zeros((2, 5, 3), dtype=bool)
    atlas[0, 0], known[0, 0] = 4, True
    atlas[:, 3:] = 9  # of a chart nobody knows anything about: stays
    filled = fill_charts(atlas, known, charts)
    np.testing.assert_array_equal(filled[:, :3], 4)
    np.testing.assert_array_equal(filled[:, 3:], 9)
