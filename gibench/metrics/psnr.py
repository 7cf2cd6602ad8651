"""Peak signal-to-noise ratio of display values."""

from __future__ import annotations

import math

from numpy.typing import ArrayLike

from gibench.metrics.inputs import FloatArray, Mask, MetricValue, display_pair, each_frame, frame_mask
from gibench.metrics.linear import squared_error
from gibench.metrics.pixelwise import mean_error
from gibench.metrics.registry import register


def decibels_of(mean_square: float) -> float:
    """Turn the mean squared error of display values in [0, 1] into decibels."""
    return math.inf if mean_square == 0 else -10 * math.log10(mean_square)


@register(
    name="psnr",
    direction="higher",
    range=(0.0, math.inf),
    identity=math.inf,
    units="dB",
    values="display",
    reference="Wang & Bovik 2009, IEEE Signal Processing Magazine 26(1)",
    of_mean_square=decibels_of,
)
def psnr(
    pred: ArrayLike, ref: ArrayLike, *, data_range: float = 1.0, mask: ArrayLike | None = None
) -> MetricValue:
    """Peak signal-to-noise ratio, 10·log₁₀(L² / mean (p − r)²) in decibels, L being the data range.

    Args:
        pred: display values in [0, data_range], (H, W, 3) or (N, H, W, 3); see `gibench.metrics.tone_map`.
        ref: the reference, of the same shape.
        data_range: the largest value that a display value can have.
        mask: booleans (H, W) or (N, H, W), True where a pixel counts.

    Returns:
        A float, or (N,) for a batch, in [0, ∞]; ∞ for equal images. An empty mask gives NaN with an
        `EmptyMaskWarning`.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: for inputs that are not such images.

    Examples:
        >>> import numpy as np
        >>> ref = np.full((2, 2, 3), 0.5)
        >>> round(psnr(ref + 0.1, ref), 3)
        20.0

    References:
        Wang & Bovik 2009, Mean squared error: love it or leave it?, IEEE Signal Processing Magazine 26(1).
    """
    prediction, reference, batched = display_pair(pred, ref, data_range=data_range)

    def decibels(p: FloatArray, r: FloatArray, chosen: Mask | None) -> float:
        error = mean_error(squared_error, p, r, chosen)
        return math.inf if error == 0 else 20 * math.log10(data_range) - 10 * math.log10(error)

    return each_frame(prediction, reference, frame_mask(mask, reference, batched), batched, decibels)
