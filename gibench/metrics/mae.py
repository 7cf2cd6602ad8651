"""Mean absolute error of linear radiance."""

import numpy as np
from numpy.typing import ArrayLike

from gibench.metrics.inputs import MetricValue
from gibench.metrics.pixelwise import Float64, linear_error
from gibench.metrics.registry import register


def absolute_error(pred: Float64, ref: Float64) -> Float64:
    """Take the size of each difference."""
    return np.abs(pred - ref)


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
