"""Denoising with Intel Open Image Denoise, through `mitsuba-oidn`.

OIDN expects independent noise from pixel to pixel, so only box-filtered images may be given to it. It is no unbiased
filter: highlights that are thousands of times brighter than the rest come back brighter and of another hue, and light
that few paths find (the sun by a second bounce, caustics) comes back darker. `denoise_part` takes that out again, as
the samples themselves say how much light there is.
"""

from __future__ import annotations

import contextlib
import importlib.metadata

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from gibench.errors import GibenchError

Image = NDArray[np.float32]

KEY = 0.18
"""Mean that the input is scaled to before the network sees it. The geometric mean, which is usual for images, is that
of the dust where a part of the light is black but for some highlights."""

BANDS = 8
"""Of brightness, with equal light in each, that the light of a denoised image is compared in with its samples."""

MOST_GAIN = 2.0
"""Largest factor that a band is brightened or darkened by: what is lost beyond that cannot be put back where it was."""

LARGEST_SCALE = 1e37

ALLOWED_CHANGE = 0.03
"""Of the mean of a part in any channel, relative; a frame with more is named."""

LEFT_CHANGE = 0.02
"""Change of a mean that is left as it is: to mend it would cost more noise than it is worth."""

EXPECTED_SPREAD = 0.1
"""Of the gains of the bands around that of the whole image; what is known of a band less well than that counts less."""

FAINT = 1e-6
"""Share of the light of a whole frame below which a part counts as black: nobody sees by what factor it changed."""

NEIGHBOURS = 5
"""Pixels on a side of the square whose brightest sample is the most that its middle may become."""


class DenoiserError(GibenchError):
    """The denoiser is not there, or refused its input."""


def denoiser_version() -> str | None:
    """Version of the installed OIDN binding, or None."""
    with contextlib.suppress(importlib.metadata.PackageNotFoundError):
        return importlib.metadata.version("mitsuba-oidn")
    return None


def input_scale(radiance: Image) -> float:
    """Exposure that puts the mean of the lit values of (H, W, 3) radiance at KEY; needs one above 0."""
    # Denormals would ask for more than float32 holds.
    return float(min(KEY / radiance[radiance > 0].mean(dtype=np.float64), LARGEST_SCALE))


def denoise(radiance: Image, *, albedo: Image | None = None, normal: Image | None = None) -> Image:
    """Removes Monte Carlo noise from one radiance image.

    radiance: (H, W, 3) float32, ≥ 0, linear, box-filtered. albedo: (H, W, 3) in [0, 1] and normal: (H, W, 3) in
    [-1, 1], both averaged over the pixel like the radiance; they may be noisy. Returns (H, W, 3) float32 ≥ 0; where
    the whole input is 0, so is the result, exactly.

    Raises DenoiserError where mitsuba-oidn is not installed.
    """
    if not radiance.any():
        return np.zeros_like(radiance)
    try:
        import mitsuba_oidn
    except ImportError as error:
        raise DenoiserError(f"the denoiser does not load ({error}); run: pip install mitsuba-oidn") from error
    result = mitsuba_oidn.denoise(
        np.ascontiguousarray(radiance, dtype=np.float32),
        albedo=None if albedo is None else np.ascontiguousarray(albedo, dtype=np.float32),
        normal=None if normal is None else np.ascontiguousarray(normal, dtype=np.float32),
        hdr=True,
        # OIDN's own choice of exposure depends on the number of threads in its last bits, and so would every pixel.
        input_scale=input_scale(radiance),
    )
    return np.maximum(np.asarray(result, dtype=np.float32), 0.0)


def denoise_part(radiance: Image, *, albedo: Image | None = None, normal: Image | None = None) -> Image:
    """As `denoise`, with the light of the samples kept: the mean of each channel within ALLOWED_CHANGE."""
    return balanced(denoise(radiance, albedo=albedo, normal=normal), radiance)


def balanced(clean: Image, samples: Image) -> Image:
    """A denoised image (H, W, 3) with the light of its samples (H, W, 3), both ≥ 0.

    No pixel stays brighter than the brightest sample around it. Where a mean is then off by more than LEFT_CHANGE,
    pixels are put into BANDS of equal light by their denoised brightness. The ratio of samples to denoised values of a
    band, in each channel, is the gain at its brightness, interpolated between bands so that no contour shows. In a
    band of few stray samples it is rather that of the whole image.
    """
    most = maximum_filter(samples, size=(NEIGHBOURS, NEIGHBOURS, 1))
    clean = np.minimum(clean, most)
    total = samples.sum((0, 1), dtype=np.float64)
    # What is cut off at the second time is little.
    for _ in range(2):
        whole = _ratio(total, clean.sum((0, 1), dtype=np.float64))
        off = float(np.abs(whole - 1).max())
        if off <= LEFT_CHANGE:
            return clean
        # As much of it as is too much, so that frames of a sequence do not jump.
        share = np.float32((off - LEFT_CHANGE) / off)
        clean = np.minimum(clean * _gains(clean, samples, whole) ** share, most)
    now = clean.sum((0, 1), dtype=np.float64)
    wanted = np.clip(now, (1 - LEFT_CHANGE) * total, (1 + LEFT_CHANGE) * total)
    return np.asarray(clean * _ratio(wanted, now), dtype=np.float32)


def mean_change(clean: Image, samples: Image, *, whole: float = 0.0) -> float:
    """By how much denoising changed the mean of a part, in the channel where it is most, relative to that mean.

    whole: mean of the frame that the part belongs to, in its brightest channel. Negative where light was lost. 0 for a
    part that is black, or as good as black beside the whole.
    """
    before, after = (image.mean((0, 1), dtype=np.float64) for image in (samples, clean))
    if before.max() <= FAINT * whole:
        return 0.0
    # A channel that is next to black in the whole part may change by any factor, and nobody sees it.
    change = (after - before) / np.maximum(before, 0.01 * before.max())
    return float(change[np.argmax(np.abs(change))])


def _ratio(samples: NDArray[np.float64], clean: NDArray[np.float64]) -> Image:
    ratio = np.divide(samples, clean, out=np.ones_like(samples), where=clean > 0)
    return np.asarray(np.clip(ratio, 1 / MOST_GAIN, MOST_GAIN), dtype=np.float32)


def _gains(clean: Image, samples: Image, whole: Image) -> Image:
    """(H, W, 3) by what each pixel is multiplied. whole: (3,) the ratio of the sums of samples to those of clean."""
    brightness = clean.mean(axis=-1, dtype=np.float64)
    lit = brightness > 0
    level = np.log2(brightness[lit])
    # Half stops are fine enough, and counting them is faster than sorting the pixels.
    step = np.floor(2 * (level - level.min())).astype(np.int64)
    light = np.bincount(step, brightness[lit])
    below = np.cumsum(light) - light / 2
    band_of = np.minimum((BANDS * below / light.sum()).astype(np.int64), BANDS - 1)
    used = np.flatnonzero(np.bincount(band_of, light, BANDS))

    def by_band(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(
            np.bincount(band_of, np.bincount(step, values, len(light)), BANDS)[used], dtype=np.float64
        )

    middle = by_band(level * brightness[lit]) / by_band(brightness[lit])
    gains = np.ones_like(clean)
    for k in range(3):
        raw, done = samples[lit][:, k].astype(np.float64), clean[lit][:, k].astype(np.float64)
        sums = by_band(done)
        gain = _ratio(by_band(raw), sums)
        error = np.sqrt(by_band((raw - done) ** 2)) / np.where(sums > 0, sums, np.inf)
        known = EXPECTED_SPREAD**2 / (EXPECTED_SPREAD**2 + error**2)
        gains[lit, k] = np.interp(level, middle, whole[k] + known * (gain - whole[k]))
    return gains
