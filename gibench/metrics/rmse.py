"""Root of the mean squared error of linear radiance."""

import math

import numpy as np
from numpy.typing import ArrayLike

from gibench.metrics.inputs import MetricValue
from gibench.metrics.mse import squared_error
from gibench.metrics.pixelwise import linear_error
from gibench.metrics.registry import register


@register(
    name="rmse",
    direction="lower",
    range=(0.0, float("inf")),
    identity=0.0,
    units="W·m⁻²·sr⁻¹",
    values="linear",
    reference="Wang & Bovik 2009, IEEE Signal Processing Magazine 26(1)",
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
    return np.sqrt(squared) if isinstance(squared, np.ndarray) else math.sqrt(squared)
