"""Colours of surfaces: perceptual hue and chroma to linear Rec. 709, luminance, range and sRGB bytes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

# Rec. 709 luminance of linear RGB.
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

# No surface of a room is blacker or whiter than this, in any channel: soot is near 0.02, fresh plaster 0.9.
DARKEST = 0.02
LIGHTEST = 0.9

# Oklab to linear Rec. 709, by way of the cube roots of cone responses.
# B. Ottosson, "A perceptual color space for image processing", 2020, section "Converting from linear sRGB".
_OKLAB_TO_ROOT_LMS = np.array(
    [
        [1.0, 0.3963377774, 0.2158037573],
        [1.0, -0.1055613458, -0.0638541728],
        [1.0, -0.0894841775, -1.2914855480],
    ]
)
_LMS_TO_RGB = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)


def luminance_of(rgb: ArrayLike) -> FloatArray:
    """Luminance Y of linear Rec. 709 colours. rgb: (..., 3) → (...)."""
    return np.asarray(rgb, np.float64) @ LUMINANCE


def fit_range(rgb: ArrayLike, low: float = DARKEST, high: float = LIGHTEST) -> FloatArray:
    """Bring linear colours into [low, high] in every channel, towards the grey of equal luminance.

    rgb: (..., 3). The luminance stays as it is, unless it lies outside [low, high] itself and is clipped.
    """
    rgb = np.asarray(rgb, np.float64)
    grey = luminance_of(rgb)[..., None]
    clipped = np.clip(grey, low, high)
    offset = rgb - grey
    room = np.where(offset > 0, high - clipped, clipped - low)
    share = np.min(
        np.where(offset == 0, 1.0, room / np.maximum(np.abs(offset), 1e-12)), axis=-1, keepdims=True
    )
    return clipped + np.minimum(share, 1.0) * offset


def lch(luminance: ArrayLike, chroma: ArrayLike, hue: ArrayLike) -> FloatArray:
    """Linear Rec. 709 colours from luminance in [0, 1], Oklab chroma (0 grey, 0.1 lively) and hue (radians).

    The arguments broadcast; the result has a last axis of 3 and exactly the luminance asked for, at the price
    of chroma where the gamut is too narrow. Hues: 0.5 red, 1.2 orange, 1.9 yellow, 2.5 green, 4.4 blue.
    """
    luminance, chroma, hue = np.broadcast_arrays(
        np.asarray(luminance, np.float64), np.asarray(chroma, np.float64), np.asarray(hue, np.float64)
    )
    # For greys, Oklab's lightness is the cube root of luminance.
    oklab = np.stack([np.cbrt(luminance), chroma * np.cos(hue), chroma * np.sin(hue)], axis=-1)
    rgb = (oklab @ _OKLAB_TO_ROOT_LMS.T) ** 3 @ _LMS_TO_RGB.T
    grey = luminance[..., None]
    rgb = rgb * (grey / np.maximum(luminance_of(rgb)[..., None], 1e-9))
    return fit_range(rgb, 0.0, 1.0)


def encode(rgb: ArrayLike) -> NDArray[np.uint8]:
    """Linear values in [0, 1] to sRGB bytes (IEC 61966-2-1), none of them above `LIGHTEST`."""
    rgb = np.asarray(rgb, np.float64)
    curve = np.where(rgb <= 0.0031308, 12.92 * rgb, 1.055 * np.maximum(rgb, 0.0) ** (1 / 2.4) - 0.055)
    ceiling = int(255 * (1.055 * LIGHTEST ** (1 / 2.4) - 0.055))
    return np.minimum(np.rint(255 * np.clip(curve, 0.0, 1.0)), ceiling).astype(np.uint8)


def decode(pixels: NDArray[np.uint8]) -> FloatArray:
    """sRGB bytes to linear values in [0, 1] (IEC 61966-2-1)."""
    curve = np.arange(256) / 255
    linear = np.where(curve <= 0.04045, curve / 12.92, ((curve + 0.055) / 1.055) ** 2.4)
    return linear[pixels]


def mean_luminance(pixels: NDArray[np.uint8]) -> float:
    """Mean linear luminance of an sRGB image, (H, W, 3) bytes."""
    counts = np.stack([np.bincount(pixels[..., c].ravel(), minlength=256) for c in range(3)], axis=-1)
    channel = (counts * decode(np.arange(256, dtype=np.uint8))[:, None]).sum(0) / pixels[..., 0].size
    return float(channel @ LUMINANCE)


def colorize(index: NDArray[np.integer], palette: ArrayLike, luminance: float) -> NDArray[np.uint8]:
    """An image from a map of palette entries, with a prescribed mean reflectance.

    index: (H, W) integers in [0, K). palette: (K, 3) linear colours, of which only the ratios of luminance
    matter. luminance: mean linear luminance that the image gets. Returns (H, W, 3) sRGB bytes within
    [DARKEST, LIGHTEST]. Working on the palette instead of the pixels is what makes textures cheap.
    """
    palette = np.asarray(palette, np.float64)
    weight = np.bincount(index.ravel(), minlength=len(palette)) / index.size
    shade = luminance_of(palette)
    scale = _scale(shade, weight, luminance)
    colors = np.zeros((len(palette), 4), np.uint8)
    colors[:, :3] = encode(fit_range(scale * palette))
    # Gathering whole 32-bit words is several times faster than gathering triples of bytes.
    return np.ascontiguousarray(
        np.take(colors.view(np.uint32)[:, 0], index).view(np.uint8).reshape(*index.shape, 4)[..., :3]
    )


def _scale(shades: FloatArray, weights: FloatArray, luminance: float) -> float:
    """Factor for luminances (K,) that gives them, once clipped, a given mean under weights that sum to 1."""
    used = weights > 0
    shades, weights = shades[used], weights[used]
    scale = luminance / max(float(weights @ shades), 1e-9)
    if scale * shades.min() >= DARKEST and scale * shades.max() <= LIGHTEST:
        return scale
    low, high = np.log(1e-3), np.log(1e3)
    for _ in range(40):  # bisection: the mean of the clipped luminances grows with the scale
        middle = 0.5 * (low + high)
        clipped = np.minimum(np.maximum(np.exp(middle) * shades, DARKEST), LIGHTEST)
        if weights @ clipped < luminance:
            low = middle
        else:
            high = middle
    return float(np.exp(0.5 * (low + high)))


def ramp(stops: ArrayLike, steps: int) -> FloatArray:
    """(steps, 3) linear colours that run evenly through the stops, (S, 3)."""
    stops = np.asarray(stops, np.float64)
    at = np.linspace(0, len(stops) - 1, steps)
    return np.stack([np.interp(at, np.arange(len(stops)), stops[:, c]) for c in range(3)], axis=-1)


def levels(values: NDArray[np.floating], steps: int) -> NDArray[np.int32]:
    """Palette entries, int32 in [0, steps), of values in [0, 1]; values outside are clipped."""
    return np.clip(values * steps, 0, steps - 1).astype(np.int32)
