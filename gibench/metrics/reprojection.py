"""From one frame to the next along exact motion: sampling the frame before, and finding what it hid.

Motion is in pixels, to the frame before: the point seen at column x, row y lay at column x + motion[…, 0] and
row y + motion[…, 1] of the frame before. The first frame of a sequence has none before it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gibench.metrics.errors import DtypeError, ShapeError
from gibench.metrics.inputs import FloatArray, Mask, check_finite, float_array
from gibench.metrics.pixelwise import Float64

PIXEL_TOLERANCE = 1e-3
"""Precision of motion in float32: smaller weights do not count, nor does so little beyond the border."""

SURFACE_TOLERANCE = 0.25
"""Largest distance, relative to that between neighbouring samples, of a reprojected point from its own
position. On a smooth surface the interpolated position is off by a few hundredths, across an edge by more."""

ROUNDING_TOLERANCE = 1e-5
"""Uncertainty of a position in float32, relative to its largest coordinate."""


class Taps(NamedTuple):
    """The four pixels around each reprojected point, in the frame before.

    Attributes:
        rows, columns: (4, H, W), inside the image.
        weights: (4, H, W), of bilinear interpolation, summing to 1.
        inside: (H, W), whether the point lies in the image at all.
    """

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    weights: Float64
    inside: Mask


def reproject(motion: FloatArray) -> Taps:
    """Find where the points of a frame lay in the frame before, from motion (H, W, 2)."""
    height, width, _ = motion.shape
    x = np.arange(width, dtype=np.float64) + motion[..., 0]
    y = np.arange(height, dtype=np.float64)[:, None] + motion[..., 1]
    inside = (
        (x >= -PIXEL_TOLERANCE)
        & (x <= width - 1 + PIXEL_TOLERANCE)
        & (y >= -PIXEL_TOLERANCE)
        & (y <= height - 1 + PIXEL_TOLERANCE)
    )
    left, across = _split(x, width)
    top, down = _split(y, height)
    right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    return Taps(
        rows=np.stack([top, top, bottom, bottom]),
        columns=np.stack([left, right, left, right]),
        weights=np.stack(
            [(1 - down) * (1 - across), (1 - down) * across, down * (1 - across), down * across]
        ),
        inside=inside,
    )


def sample(image: FloatArray, taps: Taps) -> Float64:
    """Interpolate an image (H, W, C) at reprojected points: (H, W, C); outside, the border is repeated."""
    result = np.zeros(image.shape)
    for rows, columns, weights in zip(taps.rows, taps.columns, taps.weights, strict=True):
        result += weights[..., None] * image[rows, columns]
    return result


def visibility(motion: ArrayLike, ids: ArrayLike, position: ArrayLike) -> Mask:
    """Tell which pixels show a point that the frame before shows too.

    A pixel is visible where its point lay inside the frame before, every pixel that would be interpolated
    there has its id, and the position interpolated there is its own. The geometry is taken to be at rest, as
    it is in every track; where the renderer marks motion as invalid, combine the result with that mark.

    Args:
        motion: (T, H, W, 2), pixels to the frame before; frame 0 is not looked at.
        ids: (T, H, W), integers that name surfaces, such as `shape_id`; 0 is a miss.
        position: (T, H, W, 3), world positions in metres.

    Returns:
        Booleans (T, H, W); frame 0, which has no frame before it, is False throughout.

    Raises:
        DtypeError, ShapeError, NonFiniteError: for arrays of other types, shapes, or with NaN or infinity.
    """
    movement = check_motion(motion)
    points = float_array("position", position)
    names = np.asarray(ids)
    if not np.issubdtype(names.dtype, np.integer):
        raise DtypeError(f"ids must be integers, not {names.dtype}")
    shape = movement.shape[:3]
    if names.shape != shape or points.shape != (*shape, 3):
        raise ShapeError(
            f"ids {names.shape} and position {points.shape} do not belong to motion {movement.shape}"
        )
    check_finite("position", points)

    result = np.zeros(shape, dtype=bool)
    for frame in range(1, shape[0]):
        taps = reproject(movement[frame])
        counts = taps.weights > PIXEL_TOLERANCE
        same = names[frame - 1][taps.rows, taps.columns] == names[frame]
        around = points[frame - 1][taps.rows, taps.columns].astype(np.float64)
        spacing = np.linalg.norm(around.max(axis=0) - around.min(axis=0), axis=-1)
        offset = np.linalg.norm(sample(points[frame - 1], taps) - points[frame], axis=-1)
        allowed = SURFACE_TOLERANCE * spacing + ROUNDING_TOLERANCE * np.abs(points[frame]).max(axis=-1)
        result[frame] = taps.inside & (same | ~counts).all(axis=0) & (offset <= allowed)
    return result


def check_motion(motion: ArrayLike) -> FloatArray:
    """Check motion vectors (T, H, W, 2) of at least two frames.

    Raises:
        DtypeError, ShapeError, NonFiniteError: as their names say.
    """
    array = float_array("motion", motion)
    if array.ndim != 4 or array.shape[-1] != 2 or array.shape[0] < 2 or array.size == 0:
        raise ShapeError(f"motion must be (T, H, W, 2) with at least two frames, not {array.shape}")
    check_finite("motion", array)
    return array


def _split(coordinate: Float64, size: int) -> tuple[NDArray[np.intp], Float64]:
    clipped = np.clip(coordinate, 0, size - 1)
    whole = np.minimum(clipped.astype(np.intp), max(size - 2, 0))
    return whole, clipped - whole
