"""FLIP: the difference that an observer sees when two images alternate on a display."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from gibench.metrics.errors import RangeError
from gibench.metrics.filters import filter_columns, filter_rows, gaussian
from gibench.metrics.inputs import FloatArray, Mask, MetricValue, display_pair, each_frame, frame_mask
from gibench.metrics.pixelwise import Float64, masked_mean, outside_is_nan
from gibench.metrics.registry import register
from gibench.metrics.tone_map import linear_from_srgb

PIXELS_PER_DEGREE = 0.7 * 3840 / 0.7 * np.pi / 180
"""A 4K display 0.7 m wide, 0.7 m away: 67 pixels per degree (Andersson et al. 2020, section 3)."""

XYZ_FROM_RGB = np.array(
    [
        [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
        [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
        [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
    ]
)
"""Linear Rec. 709 RGB to XYZ under D65, with the fractions that NVIDIA's implementation uses."""

WHITE_FROM_RGB = XYZ_FROM_RGB / XYZ_FROM_RGB.sum(axis=1, keepdims=True)
"""Linear RGB to XYZ divided by the XYZ of white."""

OPPONENT_FROM_RGB = np.array([[0, 116, 0], [500, -500, 0], [0, 200, -200]]) @ WHITE_FROM_RGB
"""Linear RGB to the linear opponent space YCxCz (section 4.1.1), leaving out the offset of −16 in Y."""

RGB_FROM_OPPONENT = np.linalg.inv(OPPONENT_FROM_RGB)

CONTRAST_SENSITIVITY = (((1.0, 0.0047),), ((1.0, 0.0053),), ((34.1, 0.04), (13.5, 0.025)))
"""Weight a and width b, in degrees², of the Gaussians a·√(π/b)·exp(−π²x²/b) of the distance x that model the
contrast sensitivity to Y, Cx and Cz (section 4.1.1, table 1)."""

COLOUR_EXPONENT = 0.7  # q_c, section 4.1.2
COLOUR_KNEE, COLOUR_KNEE_VALUE = 0.4, 0.95  # p_c and p_t, section 4.1.2
FEATURE_WIDTH = 0.082  # w, the width of an edge in degrees, section 4.2.1
FEATURE_EXPONENT = 0.5  # q_f, section 4.2.2

TILE_ROWS = 32
"""Rows worked on at a time, so that the two dozen planes of a tile stay in the cache."""


@register(
    name="flip",
    direction="lower",
    range=(0.0, 1.0),
    identity=0.0,
    units="1",
    values="display",
    reference="Andersson et al. 2020, PACM CGIT 3(2)",
)
def flip(
    pred: ArrayLike,
    ref: ArrayLike,
    *,
    pixels_per_degree: float = PIXELS_PER_DEGREE,
    map: bool = False,
    mask: ArrayLike | None = None,
) -> MetricValue:
    """Mean FLIP error.

    Written here although NVIDIA publishes `flip-evaluator`, against which it is tested: that package ends the
    whole process on input that it does not like, such as a black HDR reference, and is slower.

    Args:
        pred: sRGB display values in [0, 1], (H, W, 3) or (N, H, W, 3); see `gibench.metrics.tone_map`.
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
        Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström & Fairchild 2020, FLIP: a difference evaluator
        for alternating images, Proceedings of the ACM on Computer Graphics and Interactive Techniques 3(2).
    """
    prediction, reference, batched = display_pair(pred, ref)
    filters = flip_filters(pixels_per_degree)

    def error(p: FloatArray, r: FloatArray, chosen: Mask | None) -> float | Float64:
        first, second = (linear_from_srgb(image.astype(np.float64)) for image in (p, r))
        values = flip_map(first, second, filters)
        return outside_is_nan(values, chosen) if map else masked_mean(values, chosen)

    return each_frame(prediction, reference, frame_mask(mask, reference, batched), batched, error)


@dataclass(frozen=True)
class FlipFilters:
    """The separated filters for one angular resolution.

    Attributes:
        sensitivity: for Y, Cx and Cz the weight and the normalised taps of each Gaussian, all of one width.
        smooth, edge, point: the taps of a Gaussian and its first and second derivative, all of one width.
    """

    sensitivity: tuple[tuple[tuple[float, Float64], ...], ...]
    smooth: Float64
    edge: Float64
    point: Float64

    @property
    def radius(self) -> int:
        """Radius of a pixel's error, in pixels."""
        return max(len(self.sensitivity[0][0][1]), len(self.smooth)) // 2


@lru_cache(maxsize=8)
def flip_filters(pixels_per_degree: float) -> FlipFilters:
    """Sample the filters of FLIP (sections 4.1.1 and 4.2.1).

    Raises:
        RangeError: for less than one pixel per degree, where the edge filter falls between the pixels.
    """
    if not (np.isfinite(pixels_per_degree) and pixels_per_degree >= 1):
        raise RangeError(f"pixels_per_degree must be finite and at least 1, not {pixels_per_degree}")
    widest = max(b for channel in CONTRAST_SENSITIVITY for _, b in channel)
    radius = int(np.ceil(3 * np.sqrt(widest / (2 * np.pi**2)) * pixels_per_degree))
    sensitivity = []
    for channel in CONTRAST_SENSITIVITY:
        taps = [gaussian(np.sqrt(b / (2 * np.pi**2)) * pixels_per_degree, radius) for _, b in channel]
        # What a Gaussian of the distance weighs in two dimensions: its height times its sum over the window.
        weights = [
            a * np.sqrt(np.pi / b) / tap[radius] ** 2 for (a, b), tap in zip(channel, taps, strict=True)
        ]
        total = sum(weights)
        sensitivity.append(tuple((w / total, tap) for w, tap in zip(weights, taps, strict=True)))

    sigma = 0.5 * FEATURE_WIDTH * pixels_per_degree
    radius = int(np.ceil(3 * sigma))
    offsets = np.arange(-radius, radius + 1)
    smooth = gaussian(sigma, radius)
    edge = _balance(-offsets * smooth)
    point = _balance((offsets**2 / sigma**2 - 1) * smooth)
    return FlipFilters(tuple(sensitivity), smooth, edge, point)


def flip_map(pred: Float64, ref: Float64, filters: FlipFilters) -> Float64:
    """Give the FLIP error of each pixel, (H, W), from linear RGB in [0, 1], (H, W, 3)."""
    height, width, _ = ref.shape
    result = np.empty((height, width))
    for rows, tiles in _tiles((pred, ref), filters.radius):
        colour = _colour_error(*(_perceived(tile, filters) for tile in tiles))
        features = [_features(tile, filters) for tile in tiles]
        strongest = np.abs(features[0] - features[1]).max(axis=0)
        result[rows] = colour ** (1 - (strongest / np.sqrt(2)) ** FEATURE_EXPONENT)
    return result


def _tiles(images: tuple[Float64, Float64], radius: int) -> Iterator[tuple[slice, list[Float64]]]:
    # In the opponent space as planes (3, rows + 2·radius, W + 2·radius), border pixels repeated outwards.
    height, width, _ = images[0].shape
    columns = np.clip(np.arange(-radius, width + radius), 0, width - 1)
    for start in range(0, height, TILE_ROWS):
        stop = min(start + TILE_ROWS, height)
        rows = np.clip(np.arange(start - radius, stop + radius), 0, height - 1)
        yield (
            slice(start, stop),
            [np.einsum("ij,yxj->iyx", OPPONENT_FROM_RGB, image[rows])[:, :, columns] for image in images],
        )


def _perceived(tile: Float64, filters: FlipFilters) -> Float64:
    # Filtered by contrast sensitivity, clipped to the gamut, then L*a*b* with the Hunt effect: (3, rows, W).
    margin = filters.radius - len(filters.sensitivity[0][0][1]) // 2
    inner = tile[:, margin : tile.shape[1] - margin, margin : tile.shape[2] - margin]
    seen = np.stack(
        [
            sum(weight * filter_columns(filter_rows(plane, taps), taps) for weight, taps in channel)
            for plane, channel in zip(inner, filters.sensitivity, strict=True)
        ]
    )
    rgb = np.clip(np.tensordot(RGB_FROM_OPPONENT, seen, 1), 0, 1)
    return _hunt(_lab(rgb))


def _lab(rgb: Float64) -> Float64:
    # CIE 15:2004, section 8.2.1; from and to planes (3, …).
    relative = np.tensordot(WHITE_FROM_RGB, rgb, 1)
    step = 6 / 29
    x, y, z = np.where(relative > step**3, np.cbrt(relative), relative / (3 * step**2) + 4 / 29)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def _hunt(lab: Float64) -> Float64:
    # Colours look less colourful in the dark (section 4.1.2).
    return np.stack([lab[0], 0.01 * lab[0] * lab[1], 0.01 * lab[0] * lab[2]])


def _hyab(first: Float64, second: Float64) -> Float64:
    # Abasi et al. 2020, Distance metrics for very large color differences.
    difference = first - second
    return np.abs(difference[0]) + np.sqrt(difference[1] ** 2 + difference[2] ** 2)


def _colour_error(pred: Float64, ref: Float64) -> Float64:
    largest = _LARGEST_COLOUR_ERROR
    knee = COLOUR_KNEE * largest
    error = _hyab(pred, ref) ** COLOUR_EXPONENT
    below = error * (COLOUR_KNEE_VALUE / knee)
    above = COLOUR_KNEE_VALUE + (error - knee) / (largest - knee) * (1 - COLOUR_KNEE_VALUE)
    return np.where(error < knee, below, above)


def _features(tile: Float64, filters: FlipFilters) -> Float64:
    # Strength of edges and of points in the achromatic channel, brought to [0, 1]: (2, rows, W).
    margin = filters.radius - len(filters.smooth) // 2
    grey = tile[0, margin : tile.shape[1] - margin, margin : tile.shape[2] - margin] / 116
    smooth = filter_rows(grey, filters.smooth)
    strengths = []
    for derivative in (filters.edge, filters.point):
        across = filter_columns(filter_rows(grey, derivative), filters.smooth)
        down = filter_columns(smooth, derivative)
        strengths.append(np.sqrt(across * across + down * down))
    return np.stack(strengths)


def _balance(taps: Float64) -> Float64:
    # Positive taps sum to 1 and negative ones to −1 (section 4.2.1).
    return np.where(taps > 0, taps / taps[taps > 0].sum(), taps / -taps[taps < 0].sum())


_LARGEST_COLOUR_ERROR = float(
    _hyab(_hunt(_lab(np.array([0.0, 1.0, 0.0]))), _hunt(_lab(np.array([0.0, 0.0, 1.0])))) ** COLOUR_EXPONENT
)
"""Between green and blue, the two colours of the gamut that lie farthest apart (section 4.1.2)."""
