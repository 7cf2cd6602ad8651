"""HDR-FLIP: the largest FLIP error over the exposures that make an image's content visible."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gibench.metrics.flip import PIXELS_PER_DEGREE, flip_filters, flip_map
from gibench.metrics.inputs import FloatArray, Mask, MetricValue, each_frame, frame_mask, linear_pair
from gibench.metrics.pixelwise import Float64, masked_mean, outside_is_nan
from gibench.metrics.registry import register
from gibench.metrics.tone_map import LUMINANCE, lit_luminance

ACES_NUMERATOR = (0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.0)
ACES_DENOMINATOR = (0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14)
"""Coefficients of x², x and 1 in Narkowicz's fit to the ACES curve; 0.6 takes back its built-in exposure."""

SATURATED = 1e6
"""Exposed radiance from which the curve is 1 to the last bit, however far it goes on."""

BRIGHT = 0.85
"""Display value that the ends of the exposure range bring to the brightest and the median luminance
(Andersson et al. 2021, section 4)."""


@dataclass(frozen=True)
class ExposureRange:
    """The exposures, in stops, that HDR-FLIP looks at one frame with.

    Attributes:
        start: makes the brightest pixel of the reference just visible.
        stop: makes its median pixel bright; never below `start`.
        count: how many exposures there are, evenly spaced with both ends.
    """

    start: float
    stop: float
    count: int


@register(
    name="hdrflip",
    direction="lower",
    range=(0.0, 1.0),
    identity=0.0,
    units="1",
    values="linear",
    reference="Andersson et al. 2021, Eurographics short papers",
)
def hdrflip(
    pred: ArrayLike,
    ref: ArrayLike,
    *,
    pixels_per_degree: float = PIXELS_PER_DEGREE,
    map: bool = False,
    mask: ArrayLike | None = None,
) -> MetricValue:
    """Mean HDR-FLIP error, with the exposures that `exposure_range` takes from the reference.

    Args:
        pred: linear radiance, (H, W, 3) or (N, H, W, 3), W·m⁻²·sr⁻¹ in Rec. 709 RGB.
        ref: the reference, of the same shape.
        pixels_per_degree: of visual angle, at the display and the distance that are assumed; at least 1.
        map: give each pixel's error in place of the mean.
        mask: booleans (H, W) or (N, H, W), True where a pixel counts; the filters still see its neighbours.

    Returns:
        A float, or (N,) for a batch, in [0, 1]; with `map` (H, W) or (N, H, W), NaN outside the mask.
        An empty mask gives NaN with an `EmptyMaskWarning`.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: for inputs that are not such images.

    References:
        Andersson, Nilsson, Shirley & Akenine-Möller 2021, Visualizing errors in rendered high dynamic range
        images, Eurographics 2021, short papers.
    """
    prediction, reference, batched = linear_pair(pred, ref)
    filters = flip_filters(pixels_per_degree)

    def error(p: FloatArray, r: FloatArray, chosen: Mask | None) -> float | Float64:
        exposures = exposure_range(r)
        first, second = p.astype(np.float64), r.astype(np.float64)
        values = np.zeros(r.shape[:2])
        for stops in np.linspace(exposures.start, exposures.stop, exposures.count):
            error_here = flip_map(aces(first, stops), aces(second, stops), filters)
            np.maximum(values, error_here, out=values)
        return outside_is_nan(values, chosen) if map else masked_mean(values, chosen)

    return each_frame(prediction, reference, frame_mask(mask, reference, batched), batched, error)


def exposure_range(ref: FloatArray) -> ExposureRange:
    """Find the exposures for one reference (Andersson et al. 2021, section 4).

    Where half of the reference is black, or as good as that (`lit_luminance`), the median of its lit pixels stands in
    for the median, which would ask for an infinite exposure. A black reference is looked at as it is, at 0 stops.

    Args:
        ref: linear radiance, (H, W, 3), finite and not negative.

    Returns:
        The range; at least two exposures unless both ends are the same.
    """
    luminance = ref @ LUMINANCE
    lit = lit_luminance(luminance)
    if not lit.size:
        return ExposureRange(0.0, 0.0, 1)
    # The upper one of the two middle values where their number is even, as NVIDIA's implementation takes it.
    middle = luminance.size // 2
    median = float(np.partition(luminance, middle, axis=None)[middle])
    if median < lit.min():
        median = float(np.median(lit))
    start, stop = (math.log2(_BRIGHT_INPUT / value) for value in (float(lit.max()), median))
    return ExposureRange(start, stop, 1 if start == stop else max(2, math.ceil(stop - start)))


def aces(radiance: Float64, stops: float) -> Float64:
    """Expose radiance, apply Narkowicz's fit to the ACES curve, and clip to [0, 1]; linear, of any shape."""
    with np.errstate(over="ignore"):
        x = np.minimum(radiance * 2.0**stops, SATURATED)
    a, b, c = ACES_NUMERATOR
    d, e, f = ACES_DENOMINATOR
    return np.clip(((a * x + b) * x + c) / ((d * x + e) * x + f), 0, 1)


def _inverse_aces(value: float) -> float:
    a, b, c = (n - value * d for n, d in zip(ACES_NUMERATOR, ACES_DENOMINATOR, strict=True))
    return (-b + math.sqrt(b * b - 4 * a * c)) / (2 * a)


_BRIGHT_INPUT = _inverse_aces(BRIGHT)
