"""Mean squared error of linear radiance."""

from numpy.typing import ArrayLike

from gibench.metrics.inputs import MetricValue
from gibench.metrics.pixelwise import Float64, linear_error
from gibench.metrics.registry import register


def squared_error(pred: Float64, ref: Float64) -> Float64:
    """Square the difference of each value."""
    difference = pred - ref
    return difference * difference


@register(
    name="mse",
    direction="lower",
    range=(0.0, float("inf")),
    identity=0.0,
    units="(W·m⁻²·sr⁻¹)²",
    values="linear",
    reference="Wang & Bovik 2009, IEEE Signal Processing Magazine 26(1)",
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

    References:
        Wang & Bovik 2009, Mean squared error: love it or leave it?, IEEE Signal Processing Magazine 26(1).
    """
    return linear_error(squared_error, pred, ref, map=map, mask=mask)
