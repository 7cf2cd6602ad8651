"""Resolution that each direction from a probe needs, relative to the others (Rodriguez et al. 2020, section 4.2.1)."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.fft import dct
from scipy.ndimage import gaussian_filter1d

SIDE = 16
"""Texels along the sides of the neighbourhood whose frequencies are looked at, N in section 4.2.1."""

BAND = 16
"""Rows that are convolved at once."""

EXPONENT = 5
"""k in section 4.2.1: how much more high frequencies count."""

LEAST_RESPONSE = 1e-5
"""Of a frequency, below which there is nothing: a constant has 16 at frequency 0, of which rounding leaves 1e-6 at the
others and two units in the last place of the normals 2e-6, more or less by the processor. The weights of the
frequencies, half a million together, would make a map of that where normals vary nowhere."""

LEAST_SMOOTHNESS = 1e-3
"""Below which a surface is diffuse: roughness is stored in half precision, which has steps of half of it below 1."""

BLUR = 5.0
"""Standard deviation of the last blur in texels, section 4.2.1."""

LEAST_FACING = 0.05
"""Cosine (3° to the surface) below which a surface's size no longer grows."""

FLOOR = 0.02
"""Of the mean: what directions without gloss get. At 0, the paper's value, they would have no place on the map."""


def resolution_map(
    smoothness: NDArray[np.floating],
    distance: NDArray[np.floating],
    normal: NDArray[np.floating],
    facing: NDArray[np.floating],
) -> NDArray[np.float64]:
    """Texels wanted per texel of a lat-long map, (H, W), positive and finite, with a mean of 1.

    smoothness: (H, W) in [0, 1], 0 for diffuse surfaces and misses. distance: (H, W) metres. normal: (H, W, 3) unit, 0
    on a miss. facing: (H, W), cosine between the ray and the normal. Where nothing is smooth it is 1 everywhere.
    """
    height = len(distance)
    elevation = np.pi * (0.5 - (np.arange(height) + 0.5) / height)
    size = np.square(distance.astype(np.float64)) / np.maximum(facing, LEAST_FACING)
    size *= np.cos(elevation)[:, None]
    smoothness = np.where(smoothness < LEAST_SMOOTHNESS, 0, smoothness)
    wanted = smoothness * (_by_mean(size) + _by_mean(complexity(normal)))
    wanted = gaussian_filter1d(wanted, BLUR, axis=1, mode="wrap")
    wanted = gaussian_filter1d(wanted, BLUR, axis=0, mode="nearest")
    wanted = np.maximum(_by_mean(wanted), FLOOR)
    return wanted / wanted.mean()


def complexity(normal: NDArray[np.floating]) -> NDArray[np.float64]:
    """Variation of normals around each texel, (H, W) ≥ 0, relative: high frequencies of a cosine transform count most.

    normal: (H, W, 3) unit, 0 on a miss, of a lat-long map; where they are alike it is exactly 0. The map goes on over
    its left and right edge; beyond its top and bottom it repeats the last row. A neighbourhood is as large at a pole
    as elsewhere.
    """
    height, width = normal.shape[:2]
    basis = dct(np.eye(SIDE), axis=0, norm="ortho").astype(np.float32)  # a frequency a row
    frequency = np.arange(SIDE)
    weight = np.hypot(*np.meshgrid(frequency, frequency, indexing="ij")) ** EXPONENT / SIDE**2
    around = (SIDE // 2, SIDE - 1 - SIDE // 2)
    padded = np.pad(normal.astype(np.float32), ((0, 0), around, (0, 0)), mode="wrap")
    padded = np.pad(padded, (around, (0, 0), (0, 0)), mode="edge")
    # One product of matrices convolves a band of rows with all frequencies.
    band = np.zeros((BAND, SIDE, BAND + SIDE - 1), dtype=np.float32)
    for row in range(BAND):
        band[row, :, row : row + SIDE] = basis
    total = np.zeros((height, width))
    for channel in np.moveaxis(padded, -1, 0):
        across = (sliding_window_view(channel, SIDE, axis=1) @ basis.T).reshape(len(channel), -1)
        for top in range(0, height, BAND):
            rows = min(BAND, height - top)
            below = across[top : top + rows + SIDE - 1]
            response = band[:rows, :, : len(below)].reshape(-1, len(below)) @ below
            response = np.abs(response).reshape(rows, SIDE, width, SIDE)
            response[response < LEAST_RESPONSE] = 0
            response *= weight.astype(np.float32)[:, None]
            total[top : top + rows] += response.sum(axis=(1, 3))
    return total


def _by_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Divided by the mean; where that is 0, as it is."""
    mean = values.mean()
    return values / mean if mean > 0 else values
