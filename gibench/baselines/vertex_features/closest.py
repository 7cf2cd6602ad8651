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
        self._at, self._first = _triangles_at(mesh)
        self._shares = _shares(mesh.vertices[mesh.triangles].astype(np.float64))

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
        nearest = self._tree.query(asked, k=[*range(1, number + 1)])[1].ravel()  # (N · number,)
        first, many = self._first[nearest], np.diff(self._first)[nearest]
        # All triangles at the vertices of a place, one place after the other.
        begin = np.cumsum(many) - many
        candidate = self._at[np.repeat(first - begin, many) + np.arange(many.sum())]  # (M,)
        starts = begin[::number]
        sizes = np.diff(starts, append=len(candidate))
        place = np.repeat(asked, sizes, axis=0)
        weights = _barycentric(self._shares[candidate], place[:, :3])
        feet = np.einsum("mp,mpc->mc", weights, self._features[self.mesh.triangles[candidate]])
        away = np.square(feet - place).sum(axis=1)
        nearer = np.flatnonzero(away == np.repeat(np.minimum.reduceat(away, starts), sizes))
        best = nearer[np.searchsorted(nearer, starts)]  # of equal ones the first
        return (
            self.mesh.triangles[candidate[best]],
            weights[best].astype(np.float32),
            np.sqrt(away[best]),
        )


def _triangles_at(mesh: Mesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Triangles at the vertices, one vertex after the other, AROUND of each at most; and where each begins (V + 1,)."""
    vertex = mesh.triangles.ravel()
    triangle = np.repeat(np.arange(len(mesh.triangles)), 3)
    order = np.argsort(vertex, kind="stable")
    vertex, triangle = vertex[order], triangle[order]
    first = np.searchsorted(vertex, np.arange(len(mesh.vertices)))
    few = np.arange(len(vertex)) - first[vertex] < AROUND
    return triangle[few], np.searchsorted(vertex[few], np.arange(len(mesh.vertices) + 1))


def _shares(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T, 2, 4): of triangles with corners (T, 3, 3), what makes of (x, y, z, 1) the shares of the second corner and of
    the third at the foot of a place on their planes.
    """
    a, b, c = (corners[:, k] for k in range(3))
    u, v = b - a, c - a
    uu, uv, vv = (np.einsum("tc,tc->t", p, q)[:, None] for p, q in ((u, u), (u, v), (v, v)))
    size = uu * vv - uv**2
    flat = size <= 1e-12 * uu * vv
    rows = np.stack([vv * u - uv * v, uu * v - uv * u], axis=1) / np.where(flat, 1, size)[..., None]
    # A triangle that is a line is its first corner.
    rows[flat[:, 0]] = 0
    return np.concatenate([rows, -np.einsum("tkc,tc->tk", rows, a)[..., None]], axis=2)


def _barycentric(shares: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """(M, 3) weights of corners at the feet of places (M, 3), none below 0. shares: (M, 2, 4), of their triangles."""
    last_two = np.einsum("mkc,mc->mk", shares[..., :3], places) + shares[..., 3]
    weights = np.concatenate([1 - last_two.sum(axis=1, keepdims=True), last_two], axis=1)
    np.maximum(weights, 0, out=weights)
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))
