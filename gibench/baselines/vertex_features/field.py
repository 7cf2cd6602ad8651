"""Features on the vertices of a mesh, between which they are interpolated."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from torch import Tensor, nn

from gibench.baselines.relighting.surfaces import Box
from gibench.baselines.vertex_features.remeshing import Mesh

AROUND = 12
"""Triangles at a vertex, at most, that a place may lie in."""

INITIAL = 0.1
"""Standard deviation of features before a training."""


class ClosestTriangles:
    """Where on a mesh places lie: in which triangle at their closest vertex."""

    def __init__(self, mesh: Mesh) -> None:
        """mesh: whose vertices all belong to triangles."""
        self.mesh = mesh
        self._tree = cKDTree(mesh.vertices)
        self._at = _triangles_at(mesh)

    def __call__(self, places: NDArray[np.floating]) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """Vertices (N, 3) of the triangles of places (N, 3), and barycentric weights (N, 3) ≥ 0 of sum 1.

        A place beside its triangle counts as one on its rim, or at its nearest corner.
        """
        if not len(places):
            return np.zeros((0, 3), np.int64), np.zeros((0, 3), np.float32)
        _, nearest = self._tree.query(places)
        candidates = self.mesh.triangles[self._at[nearest]]  # (N, AROUND, 3)
        corners = self.mesh.vertices[candidates].astype(np.float64)
        weights = _barycentric(corners, places[:, None])
        away = np.linalg.norm((weights[..., None] * corners).sum(axis=2) - places[:, None], axis=-1)
        best = away.argmin(axis=1)[:, None, None]
        return (
            np.take_along_axis(candidates, best, axis=1)[:, 0],
            np.take_along_axis(weights, best, axis=1)[:, 0].astype(np.float32),
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


class VertexField(nn.Module):
    """Features of places in the unit cube: softplus of what is interpolated between vertices (section 6.4)."""

    def __init__(self, mesh: Mesh, box: Box, products: int) -> None:
        """box: that the unit cube stands for. products: features of a place, M."""
        super().__init__()
        self.box = box
        self.closest = ClosestTriangles(mesh)
        self.features = nn.Parameter(INITIAL * torch.randn(len(mesh.vertices), products))

    def forward(self, points: Tensor) -> Tensor:
        """(…, 3) in [0, 1] to (…, M). The closest triangles are found on the host."""
        flat = points.detach().reshape(-1, 3).cpu().numpy().astype(np.float64)
        found = self.closest(flat * np.array(self.box.size) + np.array(self.box.lowest))
        corners, weights = (torch.from_numpy(part).to(points.device) for part in found)
        mixed = (self.features[corners] * weights[..., None]).sum(dim=1)
        return nn.functional.softplus(mixed).reshape(*points.shape[:-1], mixed.shape[1])
