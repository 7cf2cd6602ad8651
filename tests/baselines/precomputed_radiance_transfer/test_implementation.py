"""Frames of `sh-prt` beside path tracing, and what of them is exact: sums of light, light from all sides, and none."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch
import trimesh

from gibench.baselines.method import MethodError, View
from gibench.baselines.precomputed_radiance_transfer import METHOD, transfer
from gibench.baselines.precomputed_radiance_transfer.environment import projected
from gibench.baselines.relighting.surfaces import Box
from gibench.baselines.stages import Stages
from gibench.baselines.training.encodings.spherical_harmonics import spherical_harmonics
from gibench.baselines.vertex_features.remeshing import meshes_of
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.estimate import estimate_radiance
from gibench.rendering.latlong import directions
from gibench.rendering.light_rig import LightRig
from gibench.rendering.lighting import EnvironmentMap, Lighting, Shot
from gibench.rendering.panoramas import HEIGHT, Panorama
from gibench.rendering.scene import load_dict
from tests.baselines.meshes import diffuse, slab, write_glb
from tests.baselines.sites import site
from tests.rendering import scenes

CAMERA = PinholeCamera((0.2, -2.6, 1.6), (0.0, 0.2, 0.2), np.radians(50.0))

RESOLUTION, BLOCK, GRID = (48, 36), 12, 4
"""Pixels, along a side of the blocks that light is compared in, and surfaces along a side of a pixel."""

SETTINGS = {"edge": 0.1, "reflected": 4, "paths": 1024, "window": 0.0, "spp": 1, "denoise": False}

PARTS = {
    "floor": ([-1.0, -1.0, -0.1], [1.0, 1.0, 0.0], (0.7, 0.6, 0.5)),
    "wall": ([-1.0, 0.9, 0.0], [1.0, 1.0, 1.0], (0.2, 0.6, 0.7)),
    "block": ([-0.3, 0.0, 0.0], [0.3, 0.4, 0.5], (0.8, 0.3, 0.2)),
}
"""A matt corner: closed boxes, with their corners and colours."""

PLACES = directions(np.arange(2 * HEIGHT) + 0.5, (np.arange(HEIGHT) + 0.5)[:, None], HEIGHT)


def panorama(pixels):
    return Lighting(environment=EnvironmentMap(Panorama.of("made", np.asarray(pixels, np.float32))))


def coated(*reflectance):
    """Matt beneath a rough coat that itself reflects nothing."""
    black = {"type": "rgb", "value": 0.0}
    return scenes.two_sided(
        type="roughplastic",
        distribution="ggx",
        alpha=0.3,
        diffuse_reflectance=scenes.rgb(*reflectance),
        specular_reflectance=black,
    )


def corner(folder, bsdf=diffuse):
    """A site of the matt corner."""
    parts = {name: slab(low, high, bsdf(*color)) for name, (low, high, color) in PARTS.items()}
    rig = LightRig(load_dict({"type": "scene", **parts}))
    write_glb(folder, [trimesh.creation.box(bounds=[low, high]) for low, high, _ in PARTS.values()])
    return dataclasses.replace(site(rig.scene, folder), rig=rig, parts=("full", "indirect"))


@pytest.fixture(scope="module")
def where(tmp_path_factory):
    return corner(tmp_path_factory.mktemp("corner"))


@pytest.fixture(scope="module")
def rig(where):
    return where.rig


@pytest.fixture(scope="module")
def method(where):
    return prepared(where)


def prepared(where, **settings):
    made = METHOD.load()(METHOD.settings({**SETTINGS, **settings}))
    made.prepare(where)
    return made


def signed(method, light, grid=1):
    """Indirect radiance under coefficients (81, 3), as it was worked out, at grid × grid surfaces a pixel."""
    width, height = (side * grid for side in RESOLUTION)
    images = method._surfaces.read(CAMERA, (width, height))
    return method.signed(images, View(Shot(CAMERA), None, (width, height), 0, 0), method.told(light)).numpy()


def traced(rig, lighting, spp):
    """The same by paths, averaged over pixels."""
    rig.set(lighting)
    found = estimate_radiance(rig.scene, CAMERA, RESOLUTION, spp=spp)
    return found.part("indirect_diffuse").reshape(*RESOLUTION[::-1], 3)


def blocks(image, side):
    height, width = image.shape[0] // side, image.shape[1] // side
    return image.reshape(height, side, width, side, 3).mean(axis=(1, 3))


def test_a_matt_scene_under_low_frequency_light_is_as_paths_have_it(rig, method):
    """Within 2 % of the mean."""
    _assert_as_paths(rig, method, 0.02)


def test_beneath_a_coat_it_is_as_dark_as_paths_have_it(tmp_path):
    """Within 5 % of the mean; with the albedo as it is all of it would be 1.6 times as bright."""
    varnished = corner(tmp_path, coated)
    _assert_as_paths(varnished.rig, prepared(varnished, paths=256), 0.05)


def _assert_as_paths(rig, method, tolerance):
    x, y, z = np.moveaxis(PLACES, -1, 0)
    light = np.stack([1 + 0.8 * z, 1 + 0.5 * x * y + 0.3 * z, 1 - 0.6 * y + 0.3 * x], axis=-1)
    found = blocks(signed(method, projected(light), GRID), GRID * BLOCK)
    true = blocks(traced(rig, panorama(light), 1024), BLOCK)
    mean = true.mean(axis=(0, 1))
    assert (mean > 0.005).all()
    assert (np.abs(found - true).mean(axis=(0, 1)) < tolerance * mean).all()


@pytest.mark.parametrize("number", [2, 8, 20])
def test_a_harmonic_is_as_its_positive_and_its_negative_part_by_paths(rig, method, number):
    """What Sloan et al. render is what paths out of the scene give for all harmonics at once."""
    basis = spherical_harmonics(torch.from_numpy(PLACES), 8)[..., number].numpy()
    signs = ((sign * basis).clip(0) for sign in (1, -1))
    parts = [blocks(traced(rig, panorama(np.repeat(part[..., None], 3, -1)), 512), BLOCK) for part in signs]
    light = np.zeros((81, 3))
    light[number] = 1
    found = blocks(signed(method, light, GRID), GRID * BLOCK)
    assert np.abs(found - (parts[0] - parts[1])).mean() < 0.03 * (parts[0] + parts[1]).mean()


def test_light_adds_up(method):
    random = np.random.default_rng(0)
    one, other = random.normal(size=(2, 81, 3))
    both = signed(method, 2 * one - 3 * other)
    np.testing.assert_allclose(
        both, 2 * signed(method, one) - 3 * signed(method, other), atol=2e-5 * np.abs(both).max()
    )
    assert not signed(method, np.zeros((81, 3))).any()


def test_a_constant_environment_needs_its_first_coefficient_alone(method):
    light = projected(np.ones((HEIGHT, 2 * HEIGHT, 3)))
    full = signed(method, light)
    method.adjust({**method.settings, "degree": 0})
    try:
        np.testing.assert_array_equal(signed(method, light), full)
    finally:
        method.adjust({**method.settings, "degree": 8})


def test_nothing_outside_lights_a_plane_and_no_matrix_is_kept_of_what_is_inside(where, method):
    """The wall's and the block's lower sides stand on the floor, and nobody is inside of a box."""
    vertices, normals = method.transfer.sides.mesh.vertices, method.transfer.sides.normals
    assert len(method.transfer.matrices) < 0.55 * len(vertices)
    below = (vertices[:, 2] < -0.09) & (normals[:, 2] < -0.9)
    assert below.any()
    rows = method.transfer.matrices[method.transfer.row[below]]
    assert not rows.any()  # nothing reflects light up to there


def test_a_frame_says_how_much_it_rings(rig, method):
    pixels = np.full((HEIGHT, 2 * HEIGHT, 3), 1e-3, np.float32)
    pixels[40, 60] = 1e5
    lighting = panorama(pixels)
    rig.set(lighting)
    shares = []
    for strength in (0.0, 0.005):
        method.adjust({**method.settings, "window": strength})
        frame = method.render(View(Shot(CAMERA, lighting), None, RESOLUTION, 0, 0), Stages())
        assert (frame.indirect >= 0).all()
        shares.append(frame.extra)
    method.adjust({**method.settings, "window": 0.0})
    assert shares[0]["negative_environment"] == shares[0]["negative_unwindowed"] > 0.2
    assert shares[1]["negative_environment"] < shares[0]["negative_environment"] / 3
    assert shares[1]["negative_indirect"] <= shares[0]["negative_indirect"]


def test_memory_of_a_frame_does_not_grow_with_its_size(method, monkeypatch):
    from gibench.baselines.precomputed_radiance_transfer import implementation

    light = projected(np.random.default_rng(0).uniform(0, 1, (32, 64, 3)))
    whole = signed(method, light)
    monkeypatch.setattr(implementation, "PIXELS", 100)
    monkeypatch.setattr(implementation, "ROWS", 7)
    method.adjust(method.settings)
    np.testing.assert_allclose(signed(method, light), whole, rtol=1e-5, atol=1e-7)


def test_edges_grow_where_memory_ends(rig, where, monkeypatch):
    monkeypatch.setattr(transfer, "MOST_BYTES", 300 * 9 * 243 * 2)
    few = prepared(where, reflected=2, paths=64)
    assert 50 < len(few.transfer.matrices) <= 300
    assert few.transfer.edge > 0.1
    assert np.isfinite(few.transfer.matrices).all()


def test_a_bake_is_found_again_and_one_that_is_damaged_is_named(where):
    number = len(where.bakes.made)
    first = np.array(prepared(where, reflected=2, paths=64, edge=0.2).transfer.matrices)
    np.testing.assert_array_equal(prepared(where, reflected=2, paths=64, edge=0.2).transfer.matrices, first)
    assert len(where.bakes.made) == number + 1
    file = where.bakes.made[-1].folder / transfer.MATRICES
    file.write_bytes(bytes(file.stat().st_size))
    with pytest.raises(MethodError, match=r"the transfer in .* cannot be read .*: remove that folder"):
        prepared(where, reflected=2, paths=64, edge=0.2)


def test_where_no_light_arrives_there_is_none(where, monkeypatch, tmp_path):
    monkeypatch.setattr(transfer._Tracer, "lit", lambda self, vertices: vertices[:0])
    box = Box((-1.5, -1.5, -0.5), (3.0, 3.0, 2.0))
    dark = transfer.made(
        where.scene, meshes_of(where.folder), box, edge=0.2, reflected=2, paths=64, max_depth=8
    )
    transfer.write(tmp_path, dark)
    again = transfer.read(tmp_path, 2)
    assert again.matrices.shape == (1, 9, 3, 81)
    assert not again.matrices.any()
    assert not again.row.any()
