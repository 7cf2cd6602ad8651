"""The inverse of a map that moves the corners of a grid: the deformed mesh, drawn with its old corners as colours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gibench.baselines.probes.errors import ProbeError

SLACK = 1e-6
"""By which a point may lie outside of a triangle in barycentric coordinates, for rounding."""

TRIANGLES = (((0, 0), (0, 1), (1, 0)), ((1, 1), (1, 0), (0, 1)))
"""The two triangles of a cell, each as (row, column) of its corners; `warp` interpolates on the same ones."""


def inverse_map(corners: NDArray[np.floating], points: NDArray[np.floating]) -> NDArray[np.float64]:
    """Inverse images of points, (P, 2) as x and y in cells.

    corners: (H + 1, W + 1, 2), to where the corners of the grid have moved, in cells, no cell flipped. points: (h, w,
    2) on a lattice: x = points[0, :, 0], evenly spaced and the same in every row, y likewise in every column. Returns
    (h, w, 2). Raises ProbeError where a point is on no triangle.
    """
    height, width = (n - 1 for n in corners.shape[:2])
    x, y = points[0, :, 0], points[:, 0, 1]
    row, column = (grid.ravel() for grid in np.indices((height, width)))
    new, old = [], []
    for triangle in TRIANGLES:
        new.append(np.stack([corners[row + j, column + i] for j, i in triangle], axis=1))
        old.append(np.stack([np.stack([column + i, row + j], axis=-1) for j, i in triangle], axis=1))
    places, sources = np.concatenate(new).astype(np.float64), np.concatenate(old).astype(np.float64)

    # Lattice points in the box of each triangle, as pairs.
    low, high = places.min(axis=1), places.max(axis=1)
    slack = 1e-9 * max(width, height)
    first = [np.searchsorted(axis, low[:, k] - slack) for k, axis in enumerate((x, y))]
    number = [
        np.searchsorted(axis, high[:, k] + slack, side="right") - first[k] for k, axis in enumerate((x, y))
    ]
    pairs = number[0] * number[1]
    of = np.repeat(np.arange(len(places)), pairs)
    within = np.arange(len(of)) - np.repeat(np.cumsum(pairs) - pairs, pairs)
    i, j = first[0][of] + within % number[0][of], first[1][of] + within // number[0][of]

    a, b, c = (places[of, k] for k in range(3))
    offset, u, v = np.stack([x[i], y[j]], axis=-1) - a, b - a, c - a
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    usable = np.abs(area) > 0
    area = np.where(usable, area, 1)
    share_b = (offset[:, 0] * v[:, 1] - offset[:, 1] * v[:, 0]) / area
    share_c = (u[:, 0] * offset[:, 1] - u[:, 1] * offset[:, 0]) / area
    inside = np.minimum(np.minimum(share_b, share_c), 1 - share_b - share_c)
    # Of the triangles that a point is on, by rounding perhaps none, the one that it is deepest in is written last.
    order = np.argsort(inside, kind="stable")
    order = order[usable[order] & (inside[order] >= -SLACK)]
    corner, to_b, to_c = (sources[of[order], k] for k in range(3))
    value = corner + share_b[order, None] * (to_b - corner) + share_c[order, None] * (to_c - corner)
    result = np.full((*points.shape[:2], 2), np.nan)
    result[j[order], i[order]] = value
    if np.isnan(result).any():
        raise ProbeError("the map of a probe leaves a part of the sphere without texels: choose plain maps")
    return np.clip(result, 0, (width, height))


def lattice(size: tuple[int, int], cells: tuple[int, int]) -> NDArray[np.float64]:
    """The corners of a grid of `size` (width, height), (height + 1, width + 1, 2), in cells of a grid of `cells`."""
    x, y = (np.linspace(0, n, count + 1) for n, count in zip(cells, size, strict=True))
    return np.stack(np.meshgrid(x, y), axis=-1)
