"""The even mesh as light arrives at it: cut at creases, once for each of its sides, and points all around a vertex."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh
from numpy.typing import NDArray

from gibench.baselines.vertex_features.remeshing import Mesh

CREASE = np.radians(50.0)
"""Angle between two triangles above which they share no vertices: what arrives at either is not what arrives at the
other. Coarse triangles of round things turn by less."""


CLOSE = 0.5
"""Of an edge: vertices that are closer and face the same way have one matrix together. Around bevels and small things
an even mesh has many more vertices than its edge asks for."""


class Sides(NamedTuple):
    """mesh: of 2·V vertices, those of one side and then those of the other. normals: (2·V, 3), unit, away from it."""

    mesh: Mesh
    normals: NDArray[np.float32]


def sides_of(mesh: Mesh) -> Sides:
    """Both sides of a mesh. That of a closed thing which nobody sees costs nothing: no light arrives there."""
    cut = trimesh.graph.smooth_shade(
        trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False), angle=CREASE, facet_minarea=None
    )
    vertices, triangles = np.asarray(cut.vertices, np.float32), np.asarray(cut.faces, np.int64)
    normals = np.zeros((len(vertices), 3))
    np.add.at(normals, triangles, _crosses(vertices, triangles)[:, None])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 0, normals / np.where(length > 0, length, 1), [0.0, 0.0, 1.0])
    both = Mesh(
        np.concatenate([vertices, vertices]),
        np.concatenate([triangles, triangles[:, ::-1] + len(vertices)]),
    )
    return Sides(both, np.concatenate([normals, -normals]).astype(np.float32))


def spread(sides: Sides, edge: float) -> NDArray[np.bool_]:
    """(2·V,) whether a vertex stands for those beside it: of each few that are CLOSE, the one with the largest area
    around it. edge: metres.
    """
    vertices, triangles = sides.mesh
    area = np.zeros(len(vertices))
    np.add.at(area, triangles, np.linalg.norm(_crosses(vertices, triangles), axis=1)[:, None])
    places = np.concatenate([np.floor(vertices / (CLOSE * edge)), np.rint(sides.normals)], axis=1)
    _, place = np.unique(places.astype(np.int64), axis=0, return_inverse=True)
    order = np.lexsort([-area, place.ravel()])
    first = np.concatenate([[True], np.diff(place.ravel()[order]) > 0])
    found = np.zeros(len(vertices), bool)
    found[order[first]] = True
    return found


def _crosses(vertices: NDArray[np.float32], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    """(F, 3) normals of triangles, as long as twice their areas."""
    a, b, c = np.moveaxis(vertices[triangles].astype(np.float64), 1, 0)
    return np.asarray(np.cross(b - a, c - a))


class PointsAround:
    """Random points on the triangles at vertices, as dense as the vertex weighs there when it is interpolated."""

    def __init__(self, mesh: Mesh) -> None:
        """mesh: whose vertices all belong to triangles."""
        self.mesh = mesh
        crosses = _crosses(mesh.vertices, mesh.triangles)
        size = np.linalg.norm(crosses, axis=1)
        self._normals = crosses / np.where(size > 0, size, 1)[:, None]
        corner = mesh.triangles.ravel()
        order = np.argsort(corner, kind="stable")
        self._triangle, self._place = order // 3, order % 3
        self._area = np.concatenate([[0.0], np.cumsum(np.maximum(size, 1e-30)[self._triangle])])
        self._first = np.searchsorted(corner[order], np.arange(len(mesh.vertices) + 1))

    def draw(
        self, vertices: NDArray[np.int64], number: int, random: np.random.Generator
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Points and unit normals of their triangles, (N, number, 3) each, around vertices (N,)."""
        low, high = self._area[self._first[vertices]], self._area[self._first[vertices + 1]]
        # Strata of area.
        share = (np.arange(number) + random.random((len(vertices), number))) / number
        entry = np.searchsorted(self._area, low[:, None] + share * (high - low)[:, None], side="right") - 1
        entry = np.clip(entry, self._first[vertices, None], self._first[vertices + 1, None] - 1)
        triangle, place = self._triangle[entry], self._place[entry]
        # Dirichlet(2, 1, 1): the density of a point is its weight for the vertex.
        drawn = random.standard_exponential((4, *entry.shape))
        weights = np.stack([drawn[0] + drawn[1], drawn[2], drawn[3]], axis=-1)
        weights /= weights.sum(axis=-1, keepdims=True)
        corners = np.take_along_axis(
            self.mesh.triangles[triangle], (place[..., None] + np.arange(3)) % 3, axis=-1
        )
        points = np.einsum("nkp,nkpc->nkc", weights, self.mesh.vertices[corners])
        return points.astype(np.float32), self._normals[triangle].astype(np.float32)
