"""Features between vertices, and where places lie on a mesh."""

from __future__ import annotations

import numpy as np
import pytest
import torch
import trimesh

from gibench.baselines.neural_free_viewpoint_relighting.network import SMALL, TransportNetwork
from gibench.baselines.relighting.surfaces import Box
from gibench.baselines.vertex_features.closest import ClosestTriangles
from gibench.baselines.vertex_features.field import VertexField
from gibench.baselines.vertex_features.remeshing import Mesh, even_mesh

BOX = Box((-1.0, -1.0, -1.0), (2.0, 2.0, 4.0))


@pytest.fixture(scope="module")
def mesh():
    return even_mesh([trimesh.creation.box((1.2, 1.0, 0.8))], BOX, 0.1)


def on_the_surface(mesh, count, seed=0):
    random = np.random.default_rng(seed)
    triangle = random.integers(len(mesh.triangles), size=count)
    weights = random.dirichlet(np.ones(3), size=count)
    return np.einsum("nk,nkc->nc", weights, mesh.vertices[mesh.triangles[triangle]].astype(np.float64))


def test_places_on_the_mesh_are_found_to_the_millimetre(mesh):
    places = on_the_surface(mesh, 2000)
    corners, weights = ClosestTriangles(mesh)(places)
    assert (weights >= 0).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1, rtol=1e-5)
    found = np.einsum("nk,nkc->nc", weights, mesh.vertices[corners])
    assert np.linalg.norm(found - places, axis=1).max() < 0.02
    assert np.median(np.linalg.norm(found - places, axis=1)) < 1e-5


def test_no_triangle_is_much_closer(mesh):
    """Beside a search through all triangles by trimesh."""
    places = on_the_surface(mesh, 40) + np.random.default_rng(1).normal(0, 0.01, (40, 3))
    triangles = mesh.vertices[mesh.triangles].astype(np.float64)
    feet = [trimesh.triangles.closest_point(triangles, np.tile(p, (len(triangles), 1))) for p in places]
    distance = np.linalg.norm(np.array(feet) - places[:, None], axis=2).min(axis=1)
    corners, weights = ClosestTriangles(mesh)(places)
    found = np.einsum("nk,nkc->nc", weights, mesh.vertices[corners])
    ours = np.linalg.norm(found - places, axis=1)
    assert (ours >= distance - 1e-5).all()
    assert (ours - distance).mean() < 2e-3


def test_a_triangle_that_is_a_line_and_places_far_away():
    line = Mesh(np.float32([[0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.array([[0, 1, 2]]))
    corners, weights = ClosestTriangles(line)(np.array([[0.5, 1.0, 0.0], [1e6, 0.0, 0.0]]))
    assert np.isfinite(weights).all()
    np.testing.assert_array_equal(corners, [[0, 1, 2]] * 2)


def test_linear_features_stay_linear_under_softplus(mesh):
    field = VertexField(mesh, BOX, 4)
    slope = torch.tensor([[1.0, 0.0, 2.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 3.0]])
    with torch.no_grad():
        field.features.copy_(torch.from_numpy(mesh.vertices) @ slope)
    places = on_the_surface(mesh, 300)
    unit = BOX.inside(torch.from_numpy(places).float())
    found = field(unit.reshape(3, 100, 3)).reshape(300, 4)
    expected = torch.nn.functional.softplus(torch.from_numpy(places).float() @ slope)
    assert (found - expected).abs().median() < 1e-4
    assert (found - expected).abs().max() < 0.05
    assert field(unit[:0]).shape == (0, 4)


def test_vertices_learn(mesh):
    torch.manual_seed(0)
    net = TransportNetwork(VertexField(mesh, BOX, SMALL.products), SMALL, 4)
    points = BOX.inside(torch.from_numpy(on_the_surface(mesh, 50)).float())
    found = net(points, torch.rand(50, 13), torch.arange(8), torch.randn(8, 3))
    found.square().sum().backward()
    touched = net.field.features.grad.abs().sum(dim=1) > 0
    assert 20 < touched.sum() < 151
