"""Texels that a chart touches, and the points of its triangles that stand for each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.baselines.lightmap.unwrapping import Unwrapping

CHUNK = 1 << 22
"""Grid points that are looked at together, so that memory is bounded."""


@dataclass(frozen=True, eq=False)
class Coverage:
    """Points on triangles, sorted by texel; texels in row order.

    texels: (T,) int64, y · width + x, of the texels that some triangle touches. charts: (T,) int32, whose they are.
    first: (T + 1,) int64, where each texel's points begin. faces: (N,) int32, row of the unwrapping; barycentrics:
    (N, 2) float32, weights of the second and third corner.
    """

    texels: NDArray[np.int64]
    charts: NDArray[np.int32]
    first: NDArray[np.int64]
    faces: NDArray[np.int32]
    barycentrics: NDArray[np.float32]

    def without(self, hidden: NDArray[np.bool_]) -> Coverage:
        """Leave out points, and texels that lose all of theirs. A chart that would lose all keeps all.

        hidden: (N,).
        """
        texel = np.repeat(np.arange(len(self.texels)), np.diff(self.first))
        chart = self.charts[texel]
        seen = np.zeros(int(self.charts.max()) + 1, dtype=bool)
        seen[chart[~hidden]] = True
        keep = ~hidden | ~seen[chart]
        left, first = np.unique(texel[keep], return_index=True)
        return Coverage(
            self.texels[left],
            self.charts[left],
            np.append(first, np.count_nonzero(keep)).astype(np.int64),
            self.faces[keep],
            self.barycentrics[keep],
        )


def cover(unwrapping: Unwrapping, grid: int) -> Coverage:
    """Find the touched texels and up to grid² points in each.

    The points lie on a regular grid in the texel, where that grid falls on the chart. A texel that a chart touches
    between grid points has one, that of the chart which is nearest to the texel's centre.
    """
    width, height = unwrapping.size
    corners = unwrapping.corners.astype(np.float64)
    placed = np.flatnonzero(unwrapping.charts >= 0)

    # Index of a grid point: texel · grid² + place within the texel, which sorts by texel.
    owner = np.full(width * height * grid * grid, -1, dtype=np.int32)
    for faces, x, y in _points(corners * grid, placed, width * grid, height * grid):
        inside = _barycentrics(corners[faces] * grid, np.stack([x, y], axis=-1) + 0.5)
        keep = np.min(inside, axis=-1) >= 0
        texel = (y[keep] // grid) * width + x[keep] // grid
        owner[(texel * grid + y[keep] % grid) * grid + x[keep] % grid] = faces[keep]
    points = np.flatnonzero(owner >= 0)
    on_grid, place = np.divmod(points, grid * grid)
    row, column = np.divmod(place, grid)
    at_x, at_y = on_grid % width + (column + 0.5) / grid, on_grid // width + (row + 0.5) / grid
    weights = _barycentrics(corners[owner[points]], np.stack([at_x, at_y], axis=-1))[:, 1:]

    has_points = np.zeros(width * height, dtype=bool)
    has_points[on_grid] = True
    more_texels, more_faces, more_weights = _touched(corners, placed, has_points, width, height)
    texels = np.concatenate([on_grid, more_texels])
    order = np.argsort(texels, kind="stable")
    of_points = np.concatenate([owner[points], more_faces])[order].astype(np.int32)
    which, first = np.unique(texels[order], return_index=True)
    return Coverage(
        which,
        unwrapping.charts[of_points[first]],
        np.append(first, len(texels)).astype(np.int64),
        of_points,
        np.concatenate([weights, more_weights])[order].astype(np.float32),
    )


def _points(
    corners: NDArray[np.float64], which: NDArray[np.int64], width: int, height: int
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]]:
    """Pairs of a triangle and a cell in its bounding box, some at a time: (P,) triangle, column, row.

    corners: (F, 3, 2) in cells. which: the triangles that are meant.
    """
    low = np.floor(corners[which].min(axis=1)).astype(np.int64).clip(0, [width - 1, height - 1])
    high = np.floor(corners[which].max(axis=1)).astype(np.int64).clip(0, [width - 1, height - 1])
    spans = high - low + 1
    counts = spans[:, 0] * spans[:, 1]
    ends = np.cumsum(counts)
    start = 0
    while start < len(which):
        before = ends[start] - counts[start]
        stop = max(int(np.searchsorted(ends, before + CHUNK, side="right")), start + 1)
        rows = np.repeat(np.arange(start, stop), counts[start:stop])
        local = np.arange(len(rows)) - np.repeat(
            ends[start:stop] - counts[start:stop] - before, counts[start:stop]
        )
        across = spans[rows, 0]
        yield which[rows], low[rows, 0] + local % across, low[rows, 1] + local // across
        start = stop


def _barycentrics(triangles: NDArray[np.float64], points: NDArray[Any]) -> NDArray[np.float64]:
    """Weights (P, 3) of the corners of triangles (P, 3, 2) at points (P, 2); −1 for triangles without area."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    u, v, w = b - a, c - a, points - a
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    inverse = np.divide(1.0, area, out=np.zeros_like(area), where=np.abs(area) > 1e-12)
    second = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) * inverse
    third = (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]) * inverse
    weights = np.stack([1 - second - third, second, third], axis=-1)
    return np.where((inverse != 0)[:, None], weights, -1.0)


def _touched(
    corners: NDArray[np.float64],
    placed: NDArray[np.int64],
    has_points: NDArray[np.bool_],
    width: int,
    height: int,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Texels without points that a triangle touches, one each, with the triangle nearest to their centre.

    Returns (T,) texels, (T,) triangles and (T, 2) weights of the nearest point.
    """
    found: list[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]] = []
    for faces, x, y in _points(corners, placed, width, height):
        bare = ~has_points[y * width + x]
        faces, x, y = faces[bare], x[bare], y[bare]
        centres = np.stack([x, y], axis=-1) + 0.5
        touching = _overlap(corners[faces] - centres[:, None])
        faces, x, y, centres = faces[touching], x[touching], y[touching], centres[touching]
        weights, distances = _nearest(corners[faces], centres)
        found.append((y * width + x, faces, weights, distances))
    texels, faces, weights, distances = (np.concatenate(part) for part in zip(*found, strict=True))
    order = np.lexsort((distances, texels))
    texels, best = np.unique(texels[order], return_index=True)
    return texels, faces[order][best], weights[order][best]


def _overlap(triangles: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether triangles (P, 3, 2) meet the unit square around the origin (separating axes)."""
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    meets = np.all((low <= 0.5) & (high >= -0.5), axis=-1)
    edges = np.roll(triangles, -1, axis=1) - triangles
    for k in range(3):
        axis = np.stack([-edges[:, k, 1], edges[:, k, 0]], axis=-1)
        along = np.einsum("pcd,pd->pc", triangles, axis)
        reach = 0.5 * np.abs(axis).sum(axis=-1)
        meets &= (along.min(axis=-1) <= reach) & (along.max(axis=-1) >= -reach)
    return meets


def _nearest(
    triangles: NDArray[np.float64], points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weights (P, 2) of the second and third corner at the point of each triangle nearest to `points`; its distance."""
    inside = _barycentrics(triangles, points)
    weights, distances = inside[:, 1:].copy(), np.where(inside.min(axis=-1) >= 0, 0.0, np.inf)
    for k in range(3):
        start, end = triangles[:, k], triangles[:, (k + 1) % 3]
        edge = end - start
        length = np.einsum("pd,pd->p", edge, edge)
        along = np.einsum("pd,pd->p", points - start, edge)
        t = np.divide(along, length, out=np.zeros_like(along), where=length > 0).clip(0, 1)
        distance = np.linalg.norm(start + t[:, None] * edge - points, axis=-1)
        closer = distance < distances
        on_edge = np.zeros((len(points), 3))
        on_edge[:, k], on_edge[:, (k + 1) % 3] = 1 - t, t
        weights[closer], distances[closer] = on_edge[closer, 1:], distance[closer]
    return weights, distances
