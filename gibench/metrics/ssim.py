"""Structural similarity of display values."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gibench.metrics.filters import filter_columns, filter_rows, gaussian
from gibench.metrics.inputs import (
    FloatArray,
    Mask,
    MetricValue,
    check_size,
    display_pair,
    each_frame,
    frame_mask,
)
from gibench.metrics.pixelwise import Float64, masked_mean, outside_is_nan
from gibench.metrics.registry import register

RADIUS = 5
"""Half of the window: 11 taps (Wang et al. 2004, section III-C)."""

WINDOW = gaussian(1.5, RADIUS)
"""The Gaussian window, σ = 1.5 (Wang et al. 2004, section III-C)."""

K1, K2 = 0.01, 0.03
"""Constants of the luminance and the contrast term (Wang et al. 2004, section III-C)."""

TILE_ROWS = 16
"""Rows worked on at a time, so that the twelve planes of a tile stay in the cache."""


@register(
    name="ssim",
    direction="higher",
    range=(-1.0, 1.0),
    identity=1.0,
    units="1",
    values="display",
    reference="Wang et al. 2004, IEEE TIP 13(4)",
)
def ssim(
    pred: ArrayLike,
    ref: ArrayLike,
    *,
    data_range: float = 1.0,
    map: bool = False,
    mask: ArrayLike | None = None,
) -> MetricValue:
    """Mean structural similarity, each channel by itself: Gaussian window of 11 taps, population covariance.

    The mean is taken over the pixels whose whole window lies in the image, as Wang et al. do.

    Args:
        pred: display values in [0, data_range], (H, W, 3) or (N, H, W, 3); see `gibench.metrics.tone_map`.
        ref: the reference, of the same shape; at least 11×11 pixels.
        data_range: the largest value that a display value can have, L in the paper.
        map: give each pixel's similarity, averaged over its channels, in place of the mean; at the border
            the image is continued by reflection.
        mask: booleans (H, W) or (N, H, W), True where a pixel counts; its window still sees its neighbours.

    Returns:
        A float, or (N,) for a batch, in [−1, 1]; with `map` (H, W) or (N, H, W), NaN outside the mask.
        A mask without a pixel whose window fits gives NaN with an `EmptyMaskWarning`.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: for inputs that are not such images.
        ImageTooSmallError: for fewer than 11×11 pixels, where no window fits.

    References:
        Wang, Bovik, Sheikh & Simoncelli 2004, Image quality assessment: from error visibility to structural
        similarity, IEEE Transactions on Image Processing 13(4), equations 13 to 17.
    """
    prediction, reference, batched = display_pair(pred, ref, data_range=data_range)
    check_size(reference, len(WINDOW), "SSIM")

    def similarity(p: FloatArray, r: FloatArray, chosen: Mask | None) -> float | Float64:
        if map:
            border = ((RADIUS, RADIUS), (RADIUS, RADIUS), (0, 0))
            padded = (np.pad(image, border, mode="symmetric") for image in (p, r))
            return outside_is_nan(similarity_map(*padded, data_range=data_range), chosen)
        inside = None if chosen is None else chosen[RADIUS:-RADIUS, RADIUS:-RADIUS]
        return masked_mean(similarity_map(p, r, data_range=data_range), inside)

    return each_frame(prediction, reference, frame_mask(mask, reference, batched), batched, similarity)


def similarity_map(pred: FloatArray, ref: FloatArray, *, data_range: float) -> Float64:
    """Give the structural similarity where the window fits: (H, W, 3) to (H − 10, W − 10), channels averaged.

    Written in sum and difference, s = p + r and d = p − r, SSIM needs four filtered planes in place of five,
    and is exactly 1 where the images are equal:
    2μₚμᵣ = (μₛ² − μ_d²)/2, μₚ² + μᵣ² = (μₛ² + μ_d²)/2, and likewise 2σₚᵣ and σₚ² + σᵣ² from σₛ² and σ_d².
    """
    c1, c2 = 2 * (K1 * data_range) ** 2, 2 * (K2 * data_range) ** 2
    height, width = ref.shape[0] - 2 * RADIUS, ref.shape[1] - 2 * RADIUS
    result = np.empty((height, width))
    for start in range(0, height, TILE_ROWS):
        stop = min(start + TILE_ROWS, height)
        p, r = (np.moveaxis(image[start : stop + 2 * RADIUS], -1, 0) for image in (pred, ref))
        planes = np.empty((4, *p.shape))
        np.add(p, r, out=planes[0], dtype=np.float64)
        np.subtract(p, r, out=planes[1], dtype=np.float64)
        np.multiply(planes[:2], planes[:2], out=planes[2:])
        filtered = filter_rows(filter_columns(planes, WINDOW), WINDOW)
        means, variances = filtered[:2], filtered[2:]
        means *= means
        variances -= means
        similarity = (means[0] - means[1] + c1) * (variances[0] - variances[1] + c2)
        similarity /= (means[0] + means[1] + c1) * (variances[0] + variances[1] + c2)
        result[start:stop] = similarity.mean(axis=0)
    return result
