"""A map of a rectangle onto itself that gives places as much room as they want.

Rodriguez et al. 2020 (section 4.2.2) take tensorial quasi-harmonic maps (Zayer et al. 2005, "Discrete tensorial
quasi-harmonic maps"): both coordinates solve div(c ∇f) = 0. It is the equation of the potential in a sheet that
conducts: potential changes fastest where c is small. So c begins as the inverse of what is wanted, and is corrected by
what came out. Along every edge of the grid the weight is positive, so that, as in Tutte's embedding (1963), whatever c
is, no quad is flipped.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.sparse.linalg import splu

from gibench.baselines.probes.adaptive.inversion import TRIANGLES, inverse_map, lattice

ITERATIONS = 3
"""Maps, one after the other: each gives places what those before it still owe them."""

STEPS = (1.0, 0.5, 0.25)
"""Powers of what is owed that are tried until no triangle is flipped."""

LEAST_AREA = 1e-3
"""Of a cell: to what a second or third map may shrink a triangle."""

SMOOTHING = 2.0
"""Cells over which what is owed is blurred, so that a map differs little between neighbouring corners."""

RANGE = 1e4
"""Largest ratio of two conductances, so that the equations can be solved in double precision."""


def forward_map(wanted: NDArray[np.floating]) -> NDArray[np.float64]:
    """New positions of the corners of a grid's cells, (H + 1, W + 1, 2) as x and y in cells.

    wanted: (H, W) > 0, relative room of the cells. The first and last column are the same line on the sphere: they
    keep their x and have equal y. The first and last row keep their y.
    """
    wanted = np.asarray(wanted, dtype=np.float64)
    wanted = wanted / wanted.mean()
    height, width = wanted.shape
    corners = _solve(_bounded(1 / wanted))
    cells = lattice((width, height), (width, height))
    centres = cells[:-1, :-1] + 0.5
    for _ in range(ITERATIONS - 1):
        owed = np.log(wanted / areas(corners))
        owed = _interpolated(owed[..., None], inverse_map(corners, centres) - 0.5)[..., 0]
        owed = gaussian_filter(owed, SMOOTHING, mode=("nearest", "wrap"))
        for step in STEPS:
            more = _interpolated(_solve(_bounded(np.exp(-step * owed))), corners)
            # Between the corners the second map is rounded off, so that triangles may be flipped after all.
            if triangle_areas(more).min() >= LEAST_AREA:
                corners = more
                break
        else:
            break
    return corners


def _interpolated(values: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bilinearly, (h, w, C) from (H, W, C) at (h, w, 2), x and y in steps of the grid; beyond its rim the rim."""
    places = np.moveaxis(at[..., ::-1], -1, 0)
    channels = np.moveaxis(values, -1, 0)
    return np.stack([map_coordinates(c, places, order=1, mode="nearest") for c in channels], axis=-1)


def areas(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed areas of the quads between corners (H + 1, W + 1, 2): (H, W), 1 where nothing has moved."""
    one = corners[1:, 1:] - corners[:-1, :-1]
    other = corners[1:, :-1] - corners[:-1, 1:]
    return 0.5 * _cross(one, other)


def _cross(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    return one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]


def triangle_areas(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed areas of the two triangles of each quad (`inversion.TRIANGLES`), (2, H, W), ½ where nothing has moved."""
    height, width = (n - 1 for n in corners.shape[:2])
    return np.stack(
        [
            0.5 * _cross(*(corners[j : j + height, i : i + width] - first for j, i in others))
            for first, others in (
                (corners[y : y + height, x : x + width], rest) for (y, x), *rest in TRIANGLES
            )
        ]
    )


def _bounded(conductance: NDArray[np.float64]) -> NDArray[np.float64]:
    scaled = conductance / np.exp(np.log(conductance).mean())
    return np.clip(scaled, RANGE**-0.5, RANGE**0.5)


def _solve(conductance: NDArray[np.float64]) -> NDArray[np.float64]:
    height, width = conductance.shape
    # A corner's edge conducts what the cells on both of its sides do; at the rim there is one.
    tall = np.pad(conductance, ((1, 1), (0, 0)))
    across = 0.5 * (tall[1:] + tall[:-1])  # (H + 1, W), edges along x
    wide = np.pad(conductance, ((0, 0), (1, 1)))
    down = 0.5 * (wide[:, 1:] + wide[:, :-1])  # (H, W + 1), edges along y

    index = np.arange((height + 1) * (width + 1)).reshape(height + 1, width + 1)
    fixed = np.full(index.shape, np.nan)
    fixed[:, 0], fixed[:, -1] = 0, width
    x = _potential(index, across, down, fixed)

    tied = index.copy()
    tied[:, -1] = tied[:, 0]
    fixed = np.full(index.shape, np.nan)
    fixed[0], fixed[-1] = 0, height
    y = _potential(tied, across, down, fixed)
    return np.stack([x, y], axis=-1)


def _potential(
    index: NDArray[np.intp],
    across: NDArray[np.float64],
    down: NDArray[np.float64],
    fixed: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The potential of all corners. index: of the unknown of a corner. fixed: NaN where the potential is looked for."""
    start = np.concatenate([index[:, :-1].ravel(), index[:-1].ravel()])
    end = np.concatenate([index[:, 1:].ravel(), index[1:].ravel()])
    weight = np.concatenate([across.ravel(), down.ravel()])
    count = index.size
    matrix = sparse.coo_array((weight, (start, end)), shape=(count, count)).tocsr()
    matrix = matrix + matrix.T
    laplacian = sparse.diags_array(matrix.sum(axis=1)) - matrix
    value = np.full(count, np.nan)
    value[index.ravel()] = fixed.ravel()
    is_fixed = np.isfinite(value)
    used = np.zeros(count, dtype=bool)
    used[index.ravel()] = True
    free = np.flatnonzero(used & ~is_fixed)
    rows = laplacian.tocsr()[free]
    right = -rows[:, np.flatnonzero(is_fixed)] @ value[is_fixed]
    system = rows[:, free].tocsc()
    value[free] = splu(system, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve(right)
    return value[index]
