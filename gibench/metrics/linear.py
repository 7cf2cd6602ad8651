"""Errors of linear radiance that each value has by itself: squared, absolute and relative, and their means.

All of them take images (H, W, 3), or batches (N, H, W, 3), of linear radiance in Rec. 709 RGB, W·m⁻²·sr⁻¹; they are
computed and summed in float64.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from gibench.metrics.inputs import MetricValue
from gibench.metrics.pixelwise import Float64, linear_error
from gibench.metrics.registry import register

EPSILON = 0.01
"""Added to the squared reference by Rousselle et al. 2011, and to the sum of both values by Vogels et al. 2018, so that
near-black pixels do not decide the mean."""

SMALLEST, LARGEST = 1e-140, 1e140
"""Radiance between which squares keep their digits, and sums of them are numbers."""


def squared_error(pred: Float64, ref: Float64) -> Float64:
    """Square the difference of each value."""
    difference = pred - ref
    return difference * difference


def absolute_error(pred: Float64, ref: Float64) -> Float64:
    """Take the size of each difference."""
    return np.abs(pred - ref)


def relative_squared_error(pred: Float64, ref: Float64) -> Float64:
    """Divide each squared difference by the squared reference."""
    difference = pred - ref
    if max(ref.max(initial=0.0), pred.max(initial=0.0)) > LARGEST:
        ratio = difference / np.hypot(ref, math.sqrt(EPSILON))
        return ratio * ratio
    return difference * difference / (ref * ref + EPSILON)


def relative_weight(ref: Float64) -> Float64:
    """Give what `relative_squared_error` multiplies differences by before it squares them."""
    return np.asarray(1 / np.hypot(ref, math.sqrt(EPSILON)))


def symmetric_relative_error(pred: Float64, ref: Float64) -> Float64:
    """Divide the size of each difference by the sum of both values, which are not negative."""
    return np.abs(pred - ref) / (pred + ref + EPSILON)


@register(
    name="mse",
    direction="lower",
    range=(0.0, float("inf")),
    identity=0.0,
    units="(W·m⁻²·sr⁻¹)²",
    values="linear",
    reference="Wang & Bovik 2009, IEEE Signal Processing Magazine 26(1)",
    of_mean_square=float,
)
def mse(pred: ArrayLike, ref: ArrayLike, *, map: bool = False, mask: ArrayLike | None = None) -> MetricValue:
    """Mean squared error, mean (p − r)² over the pixels that count and their channels.

    A few bright pixels decide its value: in HDR images read `relmse` or `smape` beside it.

    Args:
        pred: linear radiance, (H, W, 3) or (N, H, W, 3), W·m⁻²·sr⁻¹ in Rec. 709 RGB.
        ref: the reference, of the same shape.
        map: give each pixel's error, averaged over its channels, in place of the mean.
        mask: booleans (H, W) or (N, H, W), True where a pixel counts.

    Returns:
        A float, or (N,) for a batch, in [0, ∞); with `map` (H, W) or (N, H, W), NaN outside the mask.
        An empty mask gives NaN with an `EmptyMaskWarning`.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: for inputs that are not such images.

    Examples:
        >>> import numpy as np
        >>> ref = np.full((2, 2, 3), 0.5, dtype=np.float32)
        >>> mse(ref + 0.25, ref)
        0.0625
        >>> mse(ref + 0.25, ref, map=True).shape
        (2, 2)

    References:
        Wang & Bovik 2009, Mean squared error: love it or leave it?, IEEE Signal Processing Magazine 26(1).
    """
    return linear_error(squared_error, pred, ref, map=map, mask=mask)


@register(
    name="rmse",
    direction="lower",
    range=(0.0, float("inf")),
    identity=0.0,
    units="W·m⁻²·sr⁻¹",
    values="linear",
    reference="Wang & Bovik 2009, IEEE Signal Processing Magazine 26(1)",
    of_mean_square=math.sqrt,
)
def rmse(pred: ArrayLike, ref: ArrayLike, *, map: bool = False, mask: ArrayLike | None = None) -> MetricValue:
    """Root-mean-square error, √mean (p − r)²: `mse` in the unit of radiance.

    The map is the root of each pixel's own squared error, so that rmse² is the mean of the squared map.

    Args:
        pred: linear radiance, (H, W, 3) or (N, H, W, 3), W·m⁻²·sr⁻¹ in Rec. 709 RGB.
        ref: the reference, of the same shape.
        map: give each pixel's error, averaged over its channels, in place of the mean.
        mask: booleans (H, W) or (N, H, W), True where a pixel counts.

    Returns:
        A float, or (N,) for a batch, in [0, ∞); with `map` (H, W) or (N, H, W), NaN outside the mask.
        An empty mask gives NaN with an `EmptyMaskWarning`.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: for inputs that are not such images.

    References:
        Wang & Bovik 2009, Mean squared error: love it or leave it?, IEEE Signal Processing Magazine 26(1).
    """
    squared = linear_error(squared_error, pred, ref, map=map, mask=mask)
    scale = 1.0
    first, second = np.asarray(pred), np.asarray(ref)
    largest = float(max(first.max(), second.max()))
    if not SMALLEST < largest < LARGEST and largest > 0:
        # The squares are beyond the numbers that there are, and their root is not. A power of 2 changes no digit.
        scale = 2.0 ** math.frexp(largest)[1]
        first, second = first.astype(np.float64) / scale, second.astype(np.float64) / scale
        squared = linear_error(squared_error, first, second, map=map, mask=mask)
    return scale * np.sqrt(squared) if isinstance(squared, np.ndarray) else scale * math.sqrt(squared)


@register(
    name="mae",
    direction="lower",
    range=(0.0, float("inf")),
    identity=0.0,
    units="W·m⁻²·sr⁻¹",
    values="linear",
    reference="Willmott & Matsuura 2005, Climate Research 30",
)
def mae(pred: ArrayLike, ref: ArrayLike, *, map: bool = False, mask: ArrayLike | None = None) -> MetricValue:
    """Mean absolute error, mean |p − r| over the pixels that count and their channels.

    Args:
        pred: linear radiance, (H, W, 3) or (N, H, W, 3), W·m⁻²·sr⁻¹ in Rec. 709 RGB.
        ref: the reference, of the same shape.
        map: give each pixel's error, averaged over its channels, in place of the mean.
        mask: booleans (H, W) or (N, H, W), True where a pixel counts.

    Returns:
        A float, or (N,) for a batch, in [0, ∞); with `map` (H, W) or (N, H, W), NaN outside the mask.
        An empty mask gives NaN with an `EmptyMaskWarning`.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: for inputs that are not such images.

    References:
        Willmott & Matsuura 2005, Advantages of the mean absolute error over the root mean square error,
        Climate Research 30.
    """
    return linear_error(absolute_error, pred, ref, map=map, mask=mask)


@register(
    name="relmse",
    direction="lower",
    range=(0.0, float("inf")),
    identity=0.0,
    units="1",
    values="linear",
    reference="Rousselle, Knaus & Zwicker 2011, ACM TOG 30(6)",
    of_mean_square=float,
    weight=relative_weight,
)
def relmse(
    pred: ArrayLike, ref: ArrayLike, *, map: bool = False, mask: ArrayLike | None = None
) -> MetricValue:
    """Relative mean squared error, mean (p − r)² / (r² + 0.01), each channel by itself.

    It weighs dark and bright parts of an HDR image alike and is the usual error of Monte Carlo denoising.

    Args:
        pred: linear radiance, (H, W, 3) or (N, H, W, 3), W·m⁻²·sr⁻¹ in Rec. 709 RGB.
        ref: the reference, of the same shape.
        map: give each pixel's error, averaged over its channels, in place of the mean.
        mask: booleans (H, W) or (N, H, W), True where a pixel counts.

    Returns:
        A float, or (N,) for a batch, in [0, ∞); with `map` (H, W) or (N, H, W), NaN outside the mask.
        An empty mask gives NaN with an `EmptyMaskWarning`.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: for inputs that are not such images.

    Examples:
        >>> import numpy as np
        >>> bright = np.full((2, 2, 3), 100.0)
        >>> round(relmse(1.1 * bright, bright), 4)
        0.01

    References:
        Rousselle, Knaus & Zwicker 2011, Adaptive sampling and reconstruction using greedy error
        minimization, ACM TOG 30(6).
    """
    return linear_error(relative_squared_error, pred, ref, map=map, mask=mask)


@register(
    name="smape",
    direction="lower",
    range=(0.0, 1.0),
    identity=0.0,
    units="1",
    values="linear",
    reference="Vogels et al. 2018, ACM TOG 37(4)",
)
def smape(
    pred: ArrayLike, ref: ArrayLike, *, map: bool = False, mask: ArrayLike | None = None
) -> MetricValue:
    """Symmetric relative error, mean |p − r| / (|p| + |r| + 0.01); exchanging p and r changes nothing.

    No value counts more than 1, so a firefly costs no more than a wrong pixel.

    Args:
        pred: linear radiance, (H, W, 3) or (N, H, W, 3), W·m⁻²·sr⁻¹ in Rec. 709 RGB.
        ref: the reference, of the same shape.
        map: give each pixel's error, averaged over its channels, in place of the mean.
        mask: booleans (H, W) or (N, H, W), True where a pixel counts.

    Returns:
        A float, or (N,) for a batch, in [0, 1); with `map` (H, W) or (N, H, W), NaN outside the mask.
        An empty mask gives NaN with an `EmptyMaskWarning`.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: for inputs that are not such images.

    References:
        Vogels et al. 2018, Denoising with kernel prediction and asymmetric loss functions, ACM TOG 37(4).
    """
    return linear_error(symmetric_relative_error, pred, ref, map=map, mask=mask)
