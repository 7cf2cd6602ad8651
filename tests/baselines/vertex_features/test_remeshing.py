"""Even meshes of parts that are easy, thin, open, broken and huge."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
import trimesh

from gibench.baselines.relighting.surfaces import Box
from gibench.baselines.vertex_features import remeshing
from gibench.baselines.vertex_features.remeshing import RemeshingError, even_mesh, meshes_of
from tests.baselines.meshes import write_glb

ROOM = Box((-5.0, -5.0, -5.0), (10.0, 10.0, 10.0))


def area(mesh):
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles].astype(np.float64), 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def edges(mesh):
    corners = mesh.vertices[mesh.triangles]
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).ravel()


def quad(width=2.0, height=1.0):
    corners = [[0, 0, 0], [width, 0, 0], [width, height, 0], [0, height, 0]]
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


PARTS = {
    "box": trimesh.creation.box((1, 2, 0.5)),
    "open edges": quad(),
    "thin wall": trimesh.creation.box((2, 1, 0.004)),
    "sliver": trimesh.creation.box((2, 0.01, 0.01)),
    "speck": trimesh.creation.icosphere(2, 0.01),
    "ball": trimesh.creation.icosphere(3, 0.5),
}


@pytest.mark.parametrize("part", PARTS.values(), ids=PARTS)
def test_the_surface_is_kept_and_edges_are_short(part):
    mesh = even_mesh([part], ROOM, 0.1)
    assert area(mesh) == pytest.approx(part.area, rel=0.12)
    assert edges(mesh).max() < 0.3
    assert np.quantile(edges(mesh), 0.95) < 0.2
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    np.testing.assert_allclose([low, high], part.bounds, atol=0.06)
    assert np.unique(mesh.triangles).size == len(mesh.vertices)


def test_edges_are_as_long_as_asked_for():
    for edge in (0.2, 0.1, 0.05):
        found = edges(even_mesh([quad()], ROOM, edge))
        assert np.median(found) == pytest.approx(edge, rel=0.3)
        assert np.quantile(found, 0.95) < 2 * edge


def test_parts_do_not_grow_together():
    upper = quad()
    upper.apply_translation([0, 0, 0.01])
    mesh = even_mesh([quad(), upper], ROOM, 0.1)
    for triangle in mesh.vertices[mesh.triangles]:
        assert np.ptp(triangle[:, 2]) < 1e-4


def test_what_is_broken_or_out_of_sight_is_left_out():
    line = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], process=False)
    nothing = trimesh.Trimesh([[np.nan, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False)
    far = quad()
    far.apply_translation([100, 0, 0])
    mesh = even_mesh([line, nothing, far, quad()], ROOM, 0.2)
    assert area(mesh) == pytest.approx(2, rel=0.05)
    with pytest.raises(RemeshingError, match="nothing of the scene's meshes"):
        even_mesh([line, nothing, far], ROOM, 0.2)


def test_a_ground_to_the_horizon_is_cut_off():
    ground = quad(20_000, 20_000)
    ground.apply_translation([-10_000, -10_000, 0])
    mesh = even_mesh([ground], ROOM, 0.5)
    assert area(mesh) == pytest.approx(100, rel=0.05)


def test_memory_is_bounded(monkeypatch):
    monkeypatch.setattr(remeshing, "MOST_VERTICES", 500)
    monkeypatch.setattr(remeshing, "MOST_TRIANGLES", 2000)
    fine = trimesh.creation.icosphere(5, 0.5)  # 20,480 triangles
    mesh = even_mesh([fine, quad()], ROOM, 0.001)
    assert len(mesh.vertices) < 1500
    assert area(mesh) == pytest.approx(fine.area + 2, rel=0.12)


def peak_of(part, box):
    """Bytes that NumPy holds at most while a part is remeshed."""
    tracemalloc.start()
    try:
        mesh = even_mesh([part], box, 0.1)
        return tracemalloc.get_traced_memory()[1], mesh
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("box", [ROOM, Box((-5.0, -5.0, -5.0), (5.1, 10.0, 10.0))], ids=["all", "half"])
def test_memory_does_not_grow_with_the_triangles_of_a_part(monkeypatch, box):
    monkeypatch.setattr(remeshing, "MOST_TRIANGLES", 4000)
    few, many = (trimesh.creation.icosphere(level, 0.5) for level in (5, 7))  # 20,480 and 327,680 triangles
    least, most = peak_of(few, box), peak_of(many, box)
    assert most[0] < 2 * least[0]
    assert area(most[1]) == pytest.approx(area(least[1]), rel=0.02)


def test_a_small_thing_of_many_triangles_is_kept_by_a_few(monkeypatch):
    """Of which a cell of half an edge would leave none, and which splitting would leave as it is."""
    monkeypatch.setattr(remeshing, "MOST_TRIANGLES", 2000)
    speck = trimesh.creation.icosphere(5, 0.01)
    mesh = even_mesh([speck], ROOM, 0.1)
    assert 0.5 < area(mesh) / speck.area < 2
    assert 20 < len(mesh.triangles) < 4000


def test_dust_is_left_out(monkeypatch):
    """Triangles apart from each other, each within a cell, whose side their area says."""
    monkeypatch.setattr(remeshing, "MOST_TRIANGLES", 100)
    random = np.random.default_rng(0)
    corners = random.uniform(-1e-4, 1e-4, (4000, 3, 3))
    own = (
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
        / 2
    )
    cell = random.integers(4000, 12_000, (4000, 1, 3)) + 0.5
    corners += np.array(ROOM.lowest) + cell * np.sqrt(2 * own / 100)
    dust = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(12_000).reshape(-1, 3), process=False)
    assert area(even_mesh([dust, quad()], ROOM, 0.2)) == pytest.approx(2, rel=0.05)
    with pytest.raises(RemeshingError, match="nothing of the scene's meshes"):
        even_mesh([dust], ROOM, 0.2)


def test_a_glb_comes_back_with_z_up(tmp_path):
    part = trimesh.creation.box((1, 2, 3))
    part.apply_translation([0, 5, 1.5])
    write_glb(tmp_path, [part])
    (found,) = meshes_of(tmp_path)
    np.testing.assert_allclose(found.bounds, part.bounds, atol=1e-6)
    with pytest.raises(RemeshingError, match="cannot be read"):
        meshes_of(tmp_path / "nowhere")
