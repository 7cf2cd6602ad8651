"""Separable filters on image planes, fast and without a dependency beyond NumPy."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]

BLOCK_OUTPUTS = 32
"""Outputs that one matrix product makes. Wider wastes multiplications by zero, narrower wastes calls."""

BLOCK_PRODUCTS = 1 << 18
"""Multiplications in one matrix product, up to which OpenBLAS keeps to one thread. Above, its threads wait for each
other by spinning, which on a busy machine takes twenty times as long as the work."""


def gaussian(sigma: float, radius: int) -> Float64:
    """Sample a Gaussian at −radius … radius and normalise its sum to 1: (2·radius + 1,)."""
    offsets = np.arange(-radius, radius + 1)
    weights = np.exp(-0.5 * (offsets / sigma) ** 2)
    return weights / weights.sum()


def filter_rows(planes: Float64, weights: Float64) -> Float64:
    """Correlate along the last axis, only where the window lies inside: (…, W) to (…, W − taps + 1).

    A banded matrix times a block of columns does the work of a sliding window in the tuned matrix product of
    NumPy's BLAS, which more than pays for the zeros in the band.
    """
    lines = planes.reshape(-1, planes.shape[-1])
    result = np.empty((len(lines), planes.shape[-1] - len(weights) + 1))
    for outputs, inputs, band in _blocks(result.shape[-1], weights):
        for some in _shares(len(lines), band):
            np.matmul(lines[some, inputs], band.T, out=result[some, outputs])
    return result.reshape(*planes.shape[:-1], -1)


def filter_columns(planes: Float64, weights: Float64) -> Float64:
    """Correlate along the last axis but one: (…, H, W) to (…, H − taps + 1, W); see `filter_rows`."""
    height, width = planes.shape[-2:]
    result = np.empty((*planes.shape[:-2], height - len(weights) + 1, width))
    for outputs, inputs, band in _blocks(result.shape[-2], weights):
        for some in _shares(width, band):
            np.matmul(band, planes[..., inputs, some], out=result[..., outputs, some])
    return result


def _blocks(outputs: int, weights: Float64) -> Iterator[tuple[slice, slice, Float64]]:
    # Which outputs come from which inputs, and the matrix that has the weights along its diagonal.
    taps = len(weights)
    size = min(BLOCK_OUTPUTS, outputs)
    band = np.zeros((size, size + taps - 1))
    for row in range(size):
        band[row, row : row + taps] = weights
    for start in range(0, outputs, size):
        count = min(size, outputs - start)
        reach = count + taps - 1
        yield slice(start, start + count), slice(start, start + reach), band[:count, :reach]


def _shares(lines: int, band: Float64) -> Iterator[slice]:
    size = max(1, BLOCK_PRODUCTS // band.size)
    for start in range(0, lines, size):
        yield slice(start, start + size)
