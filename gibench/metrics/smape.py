"""Symmetric mean absolute percentage error of linear radiance."""

import numpy as np
from numpy.typing import ArrayLike

from gibench.metrics.inputs import MetricValue
from gibench.metrics.pixelwise import Float64, linear_error
from gibench.metrics.registry import register

EPSILON = 0.01
"""What Vogels et al. 2018 add to the denominator, so that near-black pixels do not decide the mean."""


def symmetric_relative_error(pred: Float64, ref: Float64) -> Float64:
    """Divide the size of each difference by the sum of both values, which are not negative."""
    return np.abs(pred - ref) / (pred + ref + EPSILON)


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
