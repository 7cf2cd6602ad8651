"""Periodic noise: arrays that continue across their own edges, so that a texture tiles without a seam."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Map = NDArray[np.float32]


def band_noise(
    rng: np.random.Generator,
    shape: tuple[int, int],
    cycles: tuple[float, float],
    *,
    width: float = 0.7,
    slope: float = 0.0,
) -> Map:
    """Gaussian noise around a spatial frequency, zero mean and unit variance.

    shape: (H, W). cycles: the strongest frequency across the tile along (u, v), that is along columns and
    rows; unequal numbers give streaks. width: half width of the band, in nepers of frequency. slope:
    power-law fall-off towards high frequencies added to the band (0 none; 1 makes clouds with detail in
    them).
    """
    import scipy.fft  # takes a third of a second, which those who build no room should not pay

    amplitude = _filter(shape, cycles, width, slope)
    # A texel sums thousands of coefficients, so even coarse uniform ones give Gaussian noise; bytes are drawn fastest.
    coefficients = np.frombuffer(rng.bytes(2 * amplitude.size), np.int8).astype(np.float32)
    coefficients += np.float32(0.5)
    spectrum = coefficients.view(np.complex64).reshape(amplitude.shape)
    spectrum *= amplitude
    field = scipy.fft.irfft2(spectrum, s=shape, overwrite_x=True)
    # The mean is zero, for the constant term is.
    field *= 1 / max(float(np.sqrt(np.vdot(field, field) / field.size)), 1e-12)
    return field


@lru_cache(maxsize=64)
def _filter(shape: tuple[int, int], cycles: tuple[float, float], width: float, slope: float) -> Map:
    """Amplitudes over the half plane of frequencies; families ask for the same few again and again."""
    height, breadth = shape
    fu = np.arange(breadth // 2 + 1)[None, :] / cycles[0]
    fv = np.fft.fftfreq(height, 1 / height)[:, None] / cycles[1]
    radius = np.hypot(fu, fv)
    radius[0, 0] = 1.0
    octave = np.log(radius)
    if slope > 0:
        amplitude = np.exp(-0.5 * (np.minimum(octave, 0) / width) ** 2 - (slope + 1) * np.maximum(octave, 0))
    else:
        # An even density over the plane would crowd the high end of the band: divide by the radius.
        amplitude = np.exp(-0.5 * (octave / width) ** 2 - octave)
    amplitude[0, 0] = 0.0
    return amplitude.astype(np.float32)


def uniform(field: Map) -> Map:
    """Turn zero-mean, unit-variance Gaussian noise into noise spread evenly over [0, 1]."""
    # The normal distribution function to 3e-4, several times faster than to the last bit.
    # E. Page, "Approximations to the cumulative normal function", Applied Statistics 26, 1977, p. 75.
    odd = field * (1 + np.float32(0.044715) * (field * field))
    share: Map = np.tanh(np.float32(np.sqrt(2 / np.pi)) * odd)
    return np.float32(0.5) * (share + np.float32(1))


def white(rng: np.random.Generator, shape: tuple[int, int]) -> Map:
    """Independent uniform values in [0, 1), (H, W) float32."""
    return rng.random(shape, dtype=np.float32)


def lookup(field: Map, rows: NDArray[np.integer], columns: NDArray[np.integer]) -> Map:
    """Values at integer positions that wrap around, broadcast over rows and columns."""
    return field.ravel()[(rows % field.shape[0]) * field.shape[1] + columns % field.shape[1]]


def smoothstep(low: float, high: float, values: NDArray[np.floating]) -> NDArray[np.floating]:
    """Cubic step from 0 at low to 1 at high."""
    t = np.clip((values - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)
