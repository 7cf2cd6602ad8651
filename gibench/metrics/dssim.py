"""Structural dissimilarity of display values."""

from __future__ import annotations

from numpy.typing import ArrayLike

from gibench.metrics.inputs import MetricValue
from gibench.metrics.registry import register
from gibench.metrics.ssim import ssim


def dissimilarity(similarity: MetricValue) -> MetricValue:
    """Turn similarity in [−1, 1] into dissimilarity in [0, 1]."""
    return (1 - similarity) / 2


@register(
    name="dssim",
    direction="lower",
    range=(0.0, 1.0),
    identity=0.0,
    units="1",
    values="display",
    reference="Loza et al. 2006, FUSION",
    derived=("ssim", dissimilarity),
)
def dssim(
    pred: ArrayLike,
    ref: ArrayLike,
    *,
    data_range: float = 1.0,
    map: bool = False,
    mask: ArrayLike | None = None,
) -> MetricValue:
    """Structural dissimilarity, (1 − SSIM)/2, as the papers of glossy probe reprojection tabulate it.

    Args:
        pred: display values in [0, data_range], (H, W, 3) or (N, H, W, 3); see `gibench.metrics.tone_map`.
        ref: the reference, of the same shape; at least 11×11 pixels.
        data_range: the largest value that a display value can have.
        map: give each pixel's dissimilarity in place of the mean.
        mask: booleans (H, W) or (N, H, W), True where a pixel counts.

    Returns:
        A float, or (N,) for a batch, in [0, 1]; with `map` (H, W) or (N, H, W), NaN outside the mask.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError, ImageTooSmallError: as `ssim` does.

    References:
        Loza, Mihaylova, Canagarajah & Bull 2006, Structural similarity-based object tracking in video
        sequences, 9th International Conference on Information Fusion.
    """
    return dissimilarity(ssim(pred, ref, data_range=data_range, map=map, mask=mask))
