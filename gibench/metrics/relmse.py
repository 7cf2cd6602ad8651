"""Relative mean squared error of linear radiance."""

from numpy.typing import ArrayLike

from gibench.metrics.inputs import MetricValue
from gibench.metrics.pixelwise import Float64, linear_error
from gibench.metrics.registry import register

EPSILON = 0.01
"""What Rousselle et al. 2011 add to the squared reference, so that black pixels do not decide the mean."""


def relative_squared_error(pred: Float64, ref: Float64) -> Float64:
    """Divide each squared difference by the squared reference."""
    difference = pred - ref
    return difference * difference / (ref * ref + EPSILON)


@register(
    name="relmse",
    direction="lower",
    range=(0.0, float("inf")),
    identity=0.0,
    units="1",
    values="linear",
    reference="Rousselle, Knaus & Zwicker 2011, ACM TOG 30(6)",
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

    References:
        Rousselle, Knaus & Zwicker 2011, Adaptive sampling and reconstruction using greedy error
        minimization, ACM TOG 30(6).
    """
    return linear_error(relative_squared_error, pred, ref, map=map, mask=mask)
