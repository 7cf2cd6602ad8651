"""Sides of a mesh, points around vertices, and which vertices stand for others."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from gibench.baselines.precomputed_radiance_transfer.vertices import PointsAround, sides_of, spread
from gibench.baselines.relighting.surfaces import Box
from gibench.baselines.vertex_features.closest import ClosestTriangles, Facing
from gibench.baselines.vertex_features.remeshing import Mesh, even_mesh

BOX = Box((-2.0, -2.0, -2.0), (4.0, 4.0, 4.0))

EDGE = 0.1


@pytest.fixture(scope="module")
def thin():
    """Both sides of a wall of 4 mm, the inner ones too."""
    return sides_of(even_mesh([trimesh.creation.box((1.0, 1.0, 0.004))], BOX, EDGE))


def test_a_box_is_cut_at_its_edges_and_has_an_inside():
    sides = sides_of(even_mesh([trimesh.creation.box((1.0, 0.8, 0.6))], BOX, EDGE))
    number = len(sides.normals) // 2
    np.testing.assert_allclose(np.abs(sides.normals).max(axis=1), 1, atol=1e-5)
    np.testing.assert_allclose((sides.mesh.vertices * sides.normals).sum(axis=1)[:number] > 0, True)
    np.testing.assert_array_equal(sides.normals[number:], -sides.normals[:number])
    triangles = sides.mesh.vertices[sides.mesh.triangles].astype(np.float64)
    facing = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert ((facing[:, None] * sides.normals[sides.mesh.triangles]).sum(axis=-1) > 0).all()


def test_a_ball_is_not_cut():
    ball = even_mesh([trimesh.creation.icosphere(3, 0.5)], BOX, EDGE)
    assert len(sides_of(ball).normals) == 2 * len(ball.vertices)


def test_places_on_either_side_of_a_thin_wall_find_their_own_side(thin):
    random = np.random.default_rng(0)
    places = np.concatenate([random.uniform(-0.45, 0.45, (500, 2)), np.full((500, 1), 0.002)], axis=1)
    normals = np.tile([0.0, 0.0, 1.0], (500, 1))
    closest = ClosestTriangles(thin.mesh, Facing(thin.normals, 2 * EDGE))
    for side in (1, -1):
        corners, weights = closest(places * [1, 1, side], normals * side)
        np.testing.assert_allclose(thin.normals[corners] @ [0, 0, 1], side, atol=1e-5)
        feet = np.einsum("nk,nkc->nc", weights, thin.mesh.vertices[corners])
        # Of the wall's other face, from inside, at most: there no light arrives, so it has no matrix of its own.
        assert np.abs(feet - places * [1, 1, side]).max() < 0.0041


def test_points_lie_on_the_triangles_as_dense_as_the_vertex_weighs():
    side = np.linspace(-1, 1, 5)
    x, y = (part.ravel() for part in np.meshgrid(side, side))
    vertices = np.stack([x, y, 0 * x], axis=1).astype(np.float32)
    triangles = []
    for row in range(4):
        for column in range(4):
            a = 5 * row + column
            triangles += [[a, a + 1, a + 6], [a, a + 6, a + 5]]
    points, normals = PointsAround(Mesh(vertices, np.array(triangles))).draw(
        np.array([12, 0]), 4096, np.random.default_rng(0)
    )
    np.testing.assert_array_equal(normals, np.tile([0, 0, 1], (2, 4096, 1)))
    assert not points[..., 2].any()
    # Of a hat over six right triangles with legs of ½: centroid in the middle, ∫ x² · hat / ∫ hat = h² / 6.
    np.testing.assert_allclose(points[0].mean(axis=0), 0, atol=0.01)
    np.testing.assert_allclose((points[0, :, :2] ** 2).mean(axis=0), 0.5**2 / 6, rtol=0.05)
    assert np.abs(points[0, :, :2]).max() <= 0.5
    assert points[1, :, :2].max() <= -0.5


def test_close_vertices_that_face_the_same_way_are_few():
    fine = sides_of(even_mesh([trimesh.creation.icosphere(4, 0.05)], BOX, 0.01))
    kept = spread(fine, 0.05)
    assert 40 < kept.sum() < len(kept) / 4
    even = sides_of(even_mesh([trimesh.creation.box((1.0, 1.0, 1.0))], BOX, EDGE))
    assert spread(even, EDGE).mean() > 0.75
