"""Values for texels that have none: from their neighbours on the same chart, never from another's."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def fill_charts(
    atlas: NDArray[np.float32], known: NDArray[np.bool_], charts: NDArray[np.int32]
) -> NDArray[np.float32]:
    """Spread known values over the rest of each chart, ring by ring.

    atlas: (H, W, 3). known: (H, W, 3). charts: (H, W), −1 off all charts. A chart without a known value stays as it
    is. Returns (H, W, 3).
    """
    values, is_known, of = _framed(atlas, 0.0), _framed(known, False), _framed(charts, -1)
    steps = _steps(charts.shape[1] + 2)
    for component in range(3):
        value, told = values[:, component], is_known[:, component]
        wanting = np.flatnonzero(~told & (of >= 0))
        while len(wanting):
            around = wanting[:, None] + steps
            usable = told[around] & (of[around] == of[wanting][:, None])
            count = usable.sum(axis=1)
            gained = count > 0
            if not gained.any():
                break
            total = np.where(usable, value[around], 0).sum(axis=1, dtype=np.float64)
            value[wanting[gained]] = total[gained] / count[gained]
            told[wanting[gained]] = True
            wanting = wanting[~gained]
    return _unframed(values, charts.shape)


def dilate(atlas: NDArray[np.float32], charts: NDArray[np.int32]) -> NDArray[np.float32]:
    """Give the ring of texels around each chart the mean of its neighbours, so that bilinear lookups stay inside.

    A lookup on a chart reads texels whose centres are less than one texel away: those it touches, and this ring.
    Texels beyond become 0.
    """
    values, of = _framed(atlas, 0.0), _framed(charts, -1)
    on_chart = of >= 0
    values[~on_chart] = 0
    inner = _framed(np.ones(charts.shape, dtype=bool), False)
    bare = np.flatnonzero(~on_chart & inner)
    around = bare[:, None] + _steps(charts.shape[1] + 2)
    count = on_chart[around].sum(axis=1)
    ring = count > 0
    values[bare[ring]] = values[around[ring]].sum(axis=1, dtype=np.float64) / count[ring, None]
    return _unframed(values, charts.shape)


def _framed(image: NDArray[Any], outside: float) -> NDArray[Any]:
    """An image (H, W, …) with a frame of one texel around it, as rows of texels."""
    height, width = image.shape[:2]
    framed = np.full((height + 2, width + 2, *image.shape[2:]), outside, dtype=image.dtype)
    framed[1:-1, 1:-1] = image
    return framed.reshape((height + 2) * (width + 2), *image.shape[2:])


def _unframed(rows: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    height, width = shape
    return rows.reshape(height + 2, width + 2, *rows.shape[1:])[1:-1, 1:-1].copy()


def _steps(width: int) -> NDArray[np.int64]:
    """From a texel to its eight neighbours, in rows of this width."""
    return np.array([dy * width + dx for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dx or dy])
