"""Cells around scattered points on a torus, the pattern of chips, pebbles and hides."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Cells(NamedTuple):
    """number: (H, W) int32 index of the nearest point.

    nearest, second: (H, W) float32 distances to the nearest and the second nearest point, in grid spacings.
    """

    number: NDArray[np.int32]
    nearest: NDArray[np.float32]
    second: NDArray[np.float32]


def cells(rng: np.random.Generator, shape: tuple[int, int], count: int) -> Cells:
    """Cells around one random point in each square of a count × count grid that wraps around.

    Only the nine squares around a texel are searched; with points kept off the borders of their squares by a
    tenth, that finds the nearest point but for rare corners. Source: S. Worley, "A cellular texture basis
    function", SIGGRAPH 1996, section 3.
    """
    points = rng.uniform(0.1, 0.9, (2, count, count)).astype(np.float32)
    v = ((np.arange(shape[0], dtype=np.float32) + 0.5) * (count / shape[0]))[:, None]
    u = ((np.arange(shape[1], dtype=np.float32) + 0.5) * (count / shape[1]))[None, :]
    row, column = np.floor(v).astype(np.int32), np.floor(u).astype(np.int32)
    nearest = np.full(shape, np.inf, np.float32)
    second = nearest.copy()
    number = np.zeros(shape, np.int32)
    for i in (-1, 0, 1):
        for j in (-1, 0, 1):
            index = ((row + i) % count) * count + (column + j) % count
            square = (points[0].ravel()[index] + (row + i) - v) ** 2 + (
                points[1].ravel()[index] + (column + j) - u
            ) ** 2
            np.minimum(second, np.maximum(square, nearest), out=second)
            closer = square < nearest
            number = np.where(closer, index, number)
            np.minimum(nearest, square, out=nearest)
    return Cells(number, np.sqrt(nearest), np.sqrt(second))
