"""OIDN's filter for lightmaps, which needs no guides, on a sheet where each chart stands by itself.

In the atlas charts stand one texel apart: the sunlit outside of a wall beside the inside of a drawer. There the filter
takes noise for detail and lets the bright bleed into the dark. On the sheet a chart is surrounded by its own mirror
images: values repeated outwards would be stripes, which the filter keeps as it keeps all that has a direction.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, find_objects

from gibench.rendering.denoise import DenoiserError, input_scale

MARGIN = 16
"""Texels around each chart on the sheet, in which it is mirrored."""


def denoise_lightmap(atlas: NDArray[np.float32], charts: NDArray[np.int32]) -> NDArray[np.float32]:
    """Remove the noise of an atlas.

    atlas: (H, W, 3) float32 ≥ 0. charts: (H, W) int32, −1 off all charts. Returns (H, W, 3), ≥ 0, and 0 off the charts.
    Raises DenoiserError where mitsuba-oidn is missing.
    """
    result = np.zeros_like(atlas)
    pieces = []
    for number, box in enumerate(find_objects(charts + 1)):
        own = None if box is None else charts[box] == number
        if own is not None and atlas[box][own].any():
            pieces.append((box, own))
    if not pieces:
        return result
    try:
        import mitsuba_oidn
    except ImportError as error:
        raise DenoiserError(f"the denoiser does not load ({error}); run: pip install mitsuba-oidn") from error
    sides = np.array([own.shape for _, own in pieces])
    corners, size = shelved(sides + 2 * MARGIN)
    # All charts equally bright: what is left of a neighbour beyond the margin does no harm.
    sheet = np.ones((*size, 3), dtype=np.float32)
    levels = [float(atlas[box][own].mean(dtype=np.float64)) for box, own in pieces]
    for (box, own), level, (row, column), (height, width) in zip(
        pieces, levels, corners, sides + 2 * MARGIN, strict=True
    ):
        sheet[row : row + height, column : column + width] = _surrounded(atlas[box], own) / level
    clean = mitsuba_oidn.denoise(sheet, hdr=True, filter="RTLightmap", input_scale=input_scale(sheet))
    clean = np.maximum(np.asarray(clean, dtype=np.float32), 0.0)
    for (box, own), level, (row, column), (height, width) in zip(
        pieces, levels, corners + MARGIN, sides, strict=True
    ):
        result[box][own] = clean[row : row + height, column : column + width][own] * level
    return result


def _surrounded(values: NDArray[np.float32], own: NDArray[np.bool_]) -> NDArray[np.float32]:
    """A chart and its mirror images around it: (H, W, 3) → (H + 2 MARGIN, W + 2 MARGIN, 3). own: (H, W), not empty.

    In the gaps of its box a texel takes the value on the other side of the nearest own one, where the chart goes on.
    """
    here = np.indices(own.shape)
    nearest = distance_transform_edt(~own, return_distances=False, return_indices=True)
    beyond = np.clip(2 * nearest - here, 0, np.array(own.shape)[:, None, None] - 1)
    source = np.where(own[tuple(beyond)], beyond, nearest)
    return np.pad(values[tuple(source)], ((MARGIN, MARGIN), (MARGIN, MARGIN), (0, 0)), mode="reflect")


def shelved(sides: NDArray[np.int64]) -> tuple[NDArray[np.int64], tuple[int, int]]:
    """Lay boxes out on shelves of a nearly square sheet, the highest first.

    sides: (N, 2) heights and widths, N ≥ 1. Returns (N, 2) row and column of their first corners, and the (height,
    width) of the sheet.
    """
    width = max(int(sides[:, 1].max()), int(np.ceil(np.sqrt(sides.prod(axis=1).sum()))))
    corners = np.zeros_like(sides)
    row, column, shelf = 0, 0, 0
    for number in np.argsort(-sides[:, 0], kind="stable"):
        height, length = (int(side) for side in sides[number])
        if column + length > width:
            row, column, shelf = row + shelf, 0, 0
        corners[number] = row, column
        column, shelf = column + length, max(shelf, height)
    return corners, (row + shelf, width)
