"""Root of the mean squared error of display values."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from gibench.metrics.inputs import MetricValue
from gibench.metrics.psnr import psnr
from gibench.metrics.registry import register


def error_of(decibels: MetricValue) -> MetricValue:
    """Turn the PSNR of display values in [0, 1] into their RMSE."""
    if isinstance(decibels, np.ndarray):
        return np.power(10.0, -decibels / 20)
    return math.pow(10.0, -decibels / 20)


@register(
    name="rmse_display",
    direction="lower",
    range=(0.0, 1.0),
    identity=0.0,
    units="1",
    values="display",
    reference="Wang & Bovik 2009, IEEE Signal Processing Magazine 26(1)",
    derived=("psnr", error_of),
    of_mean_square=math.sqrt,
)
def rmse_display(pred: ArrayLike, ref: ArrayLike, *, mask: ArrayLike | None = None) -> MetricValue:
    """Root-mean-square error of display values, √mean (p − r)².

    What most papers on real-time global illumination tabulate as RMSE: their values lie in [0, 1]. Linear `rmse`
    is decided by the few brightest pixels, this one by what a viewer sees.

    Args:
        pred: display values in [0, 1], (H, W, 3) or (N, H, W, 3); see `gibench.metrics.tone_map`.
        ref: the reference, of the same shape.
        mask: booleans (H, W) or (N, H, W), True where a pixel counts.

    Returns:
        A float, or (N,) for a batch, in [0, 1]. An empty mask gives NaN with an `EmptyMaskWarning`.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: for inputs that are not such images.

    References:
        Wang & Bovik 2009, Mean squared error: love it or leave it?, IEEE Signal Processing Magazine 26(1).
    """
    return error_of(psnr(pred, ref, mask=mask))
