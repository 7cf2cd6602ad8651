"""Checks of the arrays of every metric, made in one place and answered with where and how many."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gibench.metrics.errors import (
    DtypeError,
    ImageTooSmallError,
    NonFiniteError,
    RangeError,
    ShapeError,
)

FloatArray = NDArray[np.floating]
Mask = NDArray[np.bool_]
MetricValue = float | NDArray[np.float64]
"""One frame gives a float, a batch of N frames an array (N,); a map gives (H, W) or (N, H, W)."""

Measure = Callable[[FloatArray, FloatArray, Mask | None], MetricValue]

LARGEST = 1e300
"""Largest radiance in float64: the sum over the pixels of any image is still a number."""

AXES = ("frame", "row", "column", "channel")


def linear_pair(pred: ArrayLike, ref: ArrayLike) -> tuple[FloatArray, FloatArray, bool]:
    """Check two images of linear radiance and give them as batches.

    Args:
        pred: radiance, (H, W, 3) or (N, H, W, 3), floats, finite, not negative.
        ref: the reference, of the same shape.

    Returns:
        Both as (N, H, W, 3) in float32 or float64, and whether they came as a batch.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: as their names say.
    """
    pair = _pair(pred, ref)
    for name, image in (("pred", pair[0]), ("ref", pair[1])):
        check_radiance(name, image)
    return pair


def display_pair(
    pred: ArrayLike, ref: ArrayLike, *, data_range: float = 1.0
) -> tuple[FloatArray, FloatArray, bool]:
    """Check two display-referred images, whose values lie in [0, data_range], and give them as batches.

    Takes, returns and raises what `linear_pair` does. Nothing is clipped in silence.
    """
    if not (np.isfinite(data_range) and data_range > 0):
        raise RangeError(f"data_range must be positive and finite, not {data_range}")
    pair = _pair(pred, ref)
    for name, image in (("pred", pair[0]), ("ref", pair[1])):
        check_range(name, image, data_range, "bring radiance to the display with gibench.metrics.tone_map")
    return pair


def frame_mask(mask: ArrayLike | None, image: FloatArray, batched: bool) -> Mask | None:
    """Check a mask against checked images (N, H, W, 3); True marks the pixels that count.

    Args:
        mask: None, or booleans of the images' own shape without channels.
        image: one of the checked images.
        batched: whether the images came as a batch.

    Returns:
        None, or booleans (N, H, W).

    Raises:
        DtypeError: when the mask is not boolean.
        ShapeError: when its shape is another.
    """
    if mask is None:
        return None
    array = plain_array("mask", mask)
    if array.dtype != np.bool_:
        raise DtypeError(f"mask must be boolean, not {array.dtype}: compare it with something first")
    expected = image.shape[:3] if batched else image.shape[1:3]
    if array.shape != expected:
        raise ShapeError(f"mask has shape {array.shape} where the images ask for {expected}")
    return array if batched else array[None]


def float_array(name: str, value: ArrayLike) -> FloatArray:
    """Give an array of float32 or float64 of this machine's byte order; half floats become float32.

    Raises:
        DtypeError: for anything but real floating-point numbers, and for what `plain_array` refuses.
    """
    array = plain_array(name, value)
    if array.dtype.kind == "f" and array.dtype.itemsize in (2, 4, 8):
        native = array.dtype.newbyteorder("=")
        return array.astype(np.float32 if native == np.float16 else native, copy=False)
    raise DtypeError(
        f"{name} must be float16, float32 or float64, not {array.dtype}: integers carry no range, "
        "so convert them (8-bit images: divide by 255)"
    )


def plain_array(name: str, value: Any) -> NDArray[Any]:
    """Give an array of whatever says that it is one, and lose nothing on the way.

    Raises:
        DtypeError: for masked arrays with masked values, lists of rows of different lengths, and tensors that another
            library has to turn into arrays first.
    """
    if _has_masked(value):
        raise DtypeError(
            f"{name} is a masked array, whose mask would be lost: give its data, and mask=~{name}.mask.any(-1) for "
            "the pixels that count"
        )
    try:
        array = np.asarray(value)
    except Exception as problem:  # whatever a library says that will not be read
        reason = " ".join(str(problem).split())[:200]
        raise DtypeError(
            f"{name} cannot be read as an array ({reason}): rows must have one length; a tensor of torch "
            "needs .detach().cpu().float(), a sparse one .to_dense() before"
        ) from None
    return array


def _has_masked(value: Any) -> bool:
    if isinstance(value, list | tuple):
        return any(map(_has_masked, value))
    return isinstance(value, np.ma.MaskedArray) and bool(np.ma.getmaskarray(value).any())


def check_radiance(name: str, image: FloatArray) -> None:
    """Let pass radiance: finite, not negative, and so far from the largest number that a sum of it has one.

    Raises:
        NonFiniteError, RangeError: for other values.
    """
    check_range(name, image, np.inf, "radiance is never negative: clamp where the method makes it")
    if image.dtype == np.float64 and (highest := image.max()) > LARGEST:
        raise RangeError(
            f"{name} has values up to {highest:g}, of which a float64 holds no sum: divide by a unit in which they are "
            f"below {LARGEST:g}"
        )


def check_range(name: str, array: FloatArray, upper: float, advice: str) -> None:
    """Let pass an array of finite values in [0, upper].

    Raises:
        NonFiniteError: for NaN and infinity, with their number and the first place.
        RangeError: for values outside [0, upper], likewise.
    """
    # The extremes show everything that can be wrong, in two passes and without a temporary array.
    lowest, highest = array.min(), array.max()
    if not (np.isfinite(lowest) and np.isfinite(highest)):
        check_finite(name, array)
    if lowest < 0 or highest > upper:
        wrong = (array < 0) | (array > upper)
        interval = "[0, ∞)" if upper == np.inf else f"[0, {upper:g}]"
        raise RangeError(
            f"{name} has {_count(wrong, 'value')} outside {interval} (lowest {lowest:g}, "
            f"highest {highest:g}), the first at {_first(wrong)}; {advice}"
        )


def check_finite(name: str, array: FloatArray) -> None:
    """Let pass an array without NaN and infinity.

    Raises:
        NonFiniteError: with how many of each there are and where the first is.
    """
    wrong = ~np.isfinite(array)
    if wrong.any():
        nans = int(np.isnan(array).sum())
        raise NonFiniteError(
            f"{name} has {_count(wrong, 'non-finite value')} ({nans} NaN, {int(wrong.sum()) - nans} "
            f"infinite), the first at {_first(wrong)}"
        )


def check_size(image: FloatArray, smallest: int, what: str) -> None:
    """Let pass images (N, H, W, 3) of at least `smallest` pixels a side.

    Raises:
        ImageTooSmallError: otherwise, naming `what` needs the size.
    """
    height, width = image.shape[1:3]
    if min(height, width) < smallest:
        raise ImageTooSmallError(
            f"{what} needs at least {smallest}×{smallest} pixels, and the images have {height}×{width}"
        )


def each_frame(
    pred: FloatArray, ref: FloatArray, mask: Mask | None, batched: bool, measure: Measure
) -> MetricValue:
    """Measure checked images frame by frame.

    Args:
        pred: (N, H, W, 3).
        ref: (N, H, W, 3).
        mask: None, or (N, H, W).
        batched: whether the images came as a batch.
        measure: gives the number, or the map (H, W), of a frame from its prediction, reference and mask.

    Returns:
        What `measure` gives for one image, or an array with an axis of N in front for a batch.
    """
    masks = [None] * len(pred) if mask is None else list(mask)
    values = [measure(*frame) for frame in zip(pred, ref, masks, strict=True)]
    return np.stack(values) if batched else values[0]


def _pair(pred: ArrayLike, ref: ArrayLike) -> tuple[FloatArray, FloatArray, bool]:
    first, second = float_array("pred", pred), float_array("ref", ref)
    if first.shape != second.shape:
        raise ShapeError(f"pred has shape {first.shape} and ref {second.shape}: they must be equal")
    if first.ndim not in (3, 4) or first.shape[-1] != 3:
        raise ShapeError(f"images must be (H, W, 3) or (N, H, W, 3), not {first.shape}")
    if first.size == 0:
        raise ShapeError(f"images of shape {first.shape} hold no pixel")
    if first.ndim == 4:
        return first, second, True
    return first[None], second[None], False


def _count(wrong: Mask, noun: str) -> str:
    number = int(wrong.sum())
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _first(wrong: Mask) -> str:
    place = np.unravel_index(int(np.argmax(wrong)), wrong.shape)
    return ", ".join(f"{name} {index}" for name, index in zip(AXES[-wrong.ndim :], place, strict=True))
