"""Where on a mesh places lie."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gibench.baselines.vertex_features.remeshing import Mesh

AROUND = 12
"""Triangles at a vertex, at most, that a place may lie in."""


NEIGHBOURS = 4
"""Vertices whose triangles are looked at where places are told apart by their normals: of small things beside a large
one, the closest vertex may be of another thing."""

BESIDE = 0.05
"""Of `Facing.turn`: the distance above which they are."""


class Facing(NamedTuple):
    """normals: (V, 3), unit, of the vertices of a mesh. turn: metres, of which a normal at right angles is √2 away."""

    normals: NDArray[np.float32]
    turn: float

    def beside(self, places: NDArray[np.floating], normals: NDArray[np.floating]) -> NDArray[np.float64]:
        """(…, 6), between which distances grow with that of places and with the angle between normals."""
        return np.concatenate([places, self.turn * np.asarray(normals, np.float64)], axis=-1)


class ClosestTriangles:
    """Where on a mesh places lie: in which triangle at their closest vertex."""

    def __init__(self, mesh: Mesh, facing: Facing | None = None) -> None:
        """mesh: whose vertices all belong to triangles. facing: where places are told apart by their normals too."""
        self.mesh, self._facing = mesh, facing
        self._features = np.asarray(
            mesh.vertices if facing is None else facing.beside(mesh.vertices, facing.normals), np.float64
        )
        self._tree = cKDTree(self._features)
        self._at = _triangles_at(mesh)

    def __call__(
        self, places: NDArray[np.floating], normals: NDArray[np.floating] | None = None
    ) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """Vertices (N, 3) of the triangles of places (N, 3), and barycentric weights (N, 3) ≥ 0 of sum 1.

        normals: (N, 3), unit, where the mesh has such. A place beside its triangle counts as one on its rim, or at its
        nearest corner.
        """
        if not len(places):
            return np.zeros((0, 3), np.int64), np.zeros((0, 3), np.float32)
        if self._facing is None:
            corners, weights, _ = self._found(places, 1)
            return corners, weights
        assert normals is not None
        asked = self._facing.beside(places, normals)
        corners, weights, away = self._found(asked, 1)
        doubtful = away > BESIDE * self._facing.turn
        more = min(NEIGHBOURS, len(self._features))
        corners[doubtful], weights[doubtful], _ = self._found(asked[doubtful], more)
        return corners, weights

    def _found(
        self, asked: NDArray[np.floating], number: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.float64]]:
        """Corners, weights and distances by the triangles at the `number` closest vertices."""
        nearest = self._tree.query(asked, k=[*range(1, number + 1)])[1]  # (N, number)
        candidates = self.mesh.triangles[
            self._at[nearest].reshape(len(asked), number * AROUND)
        ]  # (N, number · AROUND, 3)
        weights = _barycentric(self.mesh.vertices[candidates].astype(np.float64), asked[:, None, :3])
        feet = np.einsum("nkp,nkpc->nkc", weights, self._features[candidates])
        away = np.linalg.norm(feet - asked[:, None], axis=-1)
        best = away.argmin(axis=1)[:, None]
        return (
            np.take_along_axis(candidates, best[..., None], axis=1)[:, 0],
            np.take_along_axis(weights, best[..., None], axis=1)[:, 0].astype(np.float32),
            np.take_along_axis(away, best, axis=1)[:, 0],
        )


def _triangles_at(mesh: Mesh) -> NDArray[np.int64]:
    """(V, AROUND) triangles at each vertex; where there are fewer, the first one again."""
    vertex = mesh.triangles.ravel()
    triangle = np.repeat(np.arange(len(mesh.triangles)), 3)
    order = np.argsort(vertex, kind="stable")
    vertex, triangle = vertex[order], triangle[order]
    first = np.searchsorted(vertex, np.arange(len(mesh.vertices)))
    which = np.arange(len(vertex)) - first[vertex]
    table = np.repeat(triangle[first][:, None], AROUND, axis=1)
    few = which < AROUND
    table[vertex[few], which[few]] = triangle[few]
    return table


def _barycentric(corners: NDArray[np.float64], places: NDArray[np.floating]) -> NDArray[np.float64]:
    """(…, 3) weights of corners (…, 3, 3) at the feet of places (…, 3), none below 0."""
    a, b, c = (corners[..., k, :] for k in range(3))
    u, v, w = b - a, c - a, places - a
    uu, uv, vv, wu, wv = ((p * q).sum(axis=-1) for p, q in ((u, u), (u, v), (v, v), (w, u), (w, v)))
    size = uu * vv - uv**2
    flat = size <= 1e-12 * uu * vv
    size = np.where(flat, 1, size)
    second, third = (vv * wu - uv * wv) / size, (uu * wv - uv * wu) / size
    weights = np.stack([1 - second - third, second, third], axis=-1)
    # A triangle that is a line is its first corner.
    weights = np.where(flat[..., None], [1.0, 0.0, 0.0], np.maximum(weights, 0))
    return np.asarray(weights / weights.sum(axis=-1, keepdims=True))
