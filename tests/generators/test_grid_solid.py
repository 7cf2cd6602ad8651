import numpy as np
import pytest

from gibench.generators.grid_solid import box, grid_solid, ring
from tests.generators.rooms_at_hand import directed_edges_cancel, volume

XS, YS, ZS = [0.0, 0.3, 1.0, 1.1], [-1.0, 0.5, 0.6], [0.0, 2.0, 2.5, 4.0]


@pytest.mark.parametrize("seed", range(6))
def test_encloses_the_full_cells(seed):
    full = np.random.default_rng(seed).random((3, 2, 3)) < 0.6
    mesh = grid_solid(XS, YS, ZS, full)
    cells = np.einsum("i,j,k->ijk", np.diff(XS), np.diff(YS), np.diff(ZS))
    assert directed_edges_cancel(mesh)
    assert volume(mesh.vertices, mesh.faces) == pytest.approx(cells[full].sum())


def test_normals_face_outwards_and_uvs_are_metric():
    mesh = grid_solid(XS, YS, ZS, np.ones((3, 2, 3), dtype=bool))
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    face = np.cross(b - a, c - a)
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    np.testing.assert_allclose(face, mesh.normals[mesh.faces[:, 0]], atol=1e-12)
    for p, q in ((0, 1), (1, 2), (2, 0)):
        length = np.linalg.norm(mesh.vertices[mesh.faces[:, p]] - mesh.vertices[mesh.faces[:, q]], axis=1)
        on_texture = np.linalg.norm(mesh.uvs[mesh.faces[:, p]] - mesh.uvs[mesh.faces[:, q]], axis=1)
        np.testing.assert_allclose(on_texture, length, atol=1e-12)


def test_up_is_v_on_upright_faces():
    mesh = box((0, 0, 0), (1, 2, 3))
    upright = np.abs(mesh.normals[:, 2]) < 0.5
    np.testing.assert_array_equal(mesh.uvs[upright, 1], mesh.vertices[upright, 2])


def test_ring_is_a_lattice():
    mesh = ring([0.0, 1.0, 2.0], 0.0, 0.1, [0.0, 1.0], 0.1)
    panes = 2 * (1.0 - 0.15) * 0.8
    assert directed_edges_cancel(mesh)
    assert volume(mesh.vertices, mesh.faces) == pytest.approx((2.0 * 1.0 - panes) * 0.1)
