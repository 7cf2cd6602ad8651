"""Errors that each pixel has by itself, and their mean over a frame."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gibench.metrics.errors import EmptyMaskWarning
from gibench.metrics.inputs import FloatArray, Mask, MetricValue, each_frame, frame_mask, linear_pair

Float64 = NDArray[np.float64]
ErrorFunction = Callable[[Float64, Float64], Float64]
"""Gives the error of each value from prediction and reference, both (pixels, 3)."""

BLOCK_PIXELS = 10_000
"""Pixels worked on at a time, so that a block in float64 and its temporaries stay in the cache."""


def linear_error(
    error: ErrorFunction, pred: ArrayLike, ref: ArrayLike, *, map: bool, mask: ArrayLike | None
) -> MetricValue:
    """Check images of linear radiance and give the mean, or the map, of an error for each frame."""
    prediction, reference, batched = linear_pair(pred, ref)
    measure = error_map if map else mean_error
    return each_frame(
        prediction,
        reference,
        frame_mask(mask, reference, batched),
        batched,
        lambda p, r, chosen: measure(error, p, r, chosen),
    )


def mean_error(error: ErrorFunction, pred: FloatArray, ref: FloatArray, mask: Mask | None) -> float:
    """Average an error over the channels and the pixels of one frame.

    Args:
        error: the error of a value; it is computed and summed in float64.
        pred: (H, W, 3).
        ref: (H, W, 3).
        mask: None, or (H, W): the pixels that count.

    Returns:
        The mean, or NaN with an `EmptyMaskWarning` where the mask is empty.
    """
    if mask is not None:
        pred, ref = pred[mask], ref[mask]
        if not pred.size:
            return empty_mask()
    with np.errstate(over="ignore"):  # an error beyond the largest number is infinite, and says so
        sums = [float(error(p, r).sum()) for p, r in _blocks(pred, ref)]
    try:
        return math.fsum(sums) / pred.size
    except OverflowError:
        return math.inf


def error_map(error: ErrorFunction, pred: FloatArray, ref: FloatArray, mask: Mask | None) -> Float64:
    """Give the error of each pixel of one frame, averaged over its channels: (H, W), NaN outside the mask."""
    with np.errstate(over="ignore"):
        blocks = [error(p, r).mean(axis=-1) for p, r in _blocks(pred, ref)]
    return outside_is_nan(np.concatenate(blocks).reshape(pred.shape[:2]), mask)


def masked_mean(values: Float64, mask: Mask | None) -> float:
    """Average a map (H, W) over the pixels that count; NaN with an `EmptyMaskWarning` without any."""
    chosen = values if mask is None else values[mask]
    return float(chosen.mean()) if chosen.size else empty_mask()


def outside_is_nan(values: Float64, mask: Mask | None) -> Float64:
    """Give a map with NaN at the pixels that do not count."""
    return values if mask is None else np.where(mask, values, np.nan)


def empty_mask() -> float:
    """Warn that there is nothing to average, and give NaN: an error of 0 would be a lie."""
    warnings.warn(
        "the mask leaves no pixel to average over: the result is NaN", EmptyMaskWarning, stacklevel=2
    )
    return math.nan


def _blocks(pred: FloatArray, ref: FloatArray) -> Iterator[tuple[Float64, Float64]]:
    pred, ref = pred.reshape(-1, 3), ref.reshape(-1, 3)
    for start in range(0, len(pred), BLOCK_PIXELS):
        block = slice(start, start + BLOCK_PIXELS)
        yield pred[block].astype(np.float64), ref[block].astype(np.float64)
