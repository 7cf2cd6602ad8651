"""Equirectangular (lat-long) panoramas: which direction a texel looks along, how much of the sphere it covers, and the
same panorama with another number of texels.

A panorama is (H, 2·H, C) with the zenith on top. Its column coordinate x, from 0 to 2·H, looks along azimuth
π/2 − 2π·x/(2·H) about +Z from +X, its row coordinate y, from 0 to H, along the polar angle π·y/H from +Z; (0, 0) is the
outer corner of the first texel. An `envmap` of Mitsuba that is turned by 90° about X, as Z is up here, has the same
columns; for its rows see `for_envmap`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear Rec. 709."""


def directions(x: Any, y: Any, height: int) -> NDArray[np.float64]:
    """Unit vectors (…, 3) of places in a panorama of `height` rows, in texels; x and y broadcast."""
    theta, phi = np.asarray(y) * (math.pi / height), np.asarray(x) * (math.pi / height)
    sine = np.sin(theta)
    return np.stack(np.broadcast_arrays(np.sin(phi) * sine, np.cos(phi) * sine, np.cos(theta)), axis=-1)


def coordinates(towards: NDArray[Any], height: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places (x, y) in a panorama of `height` rows, in texels, of directions (…, 3) of any length above 0."""
    x, y, z = np.moveaxis(np.asarray(towards, dtype=np.float64), -1, 0)
    # Not by the arc cosine, which has half of its digits near the poles.
    theta = np.arctan2(np.hypot(x, y), z)
    phi = np.mod(np.arctan2(x, y), 2 * math.pi)
    return phi * (height / math.pi), theta * (height / math.pi)


def solid_angles(height: int) -> NDArray[np.float64]:
    """(height,) solid angle of one texel in each row of a panorama, steradians; over all texels they sum to 4π."""
    edges = np.cos(np.linspace(0.0, math.pi, height + 1))
    return -np.diff(edges) * (math.pi / height)


def mean_luminance(panorama: NDArray[Any]) -> float:
    """Mean over the sphere of the luminance of a panorama (H, 2·H, 3) in linear Rec. 709."""
    rows = np.asarray(panorama, dtype=np.float64).mean(axis=1) @ LUMINANCE
    weights = solid_angles(len(rows))
    return float(weights @ rows / weights.sum())


def resampled(panorama: NDArray[Any], height: int) -> NDArray[np.float32]:
    """A panorama (H, 2·H, C) with `height` rows and twice as many columns, float32.

    Each new texel holds the mean over the solid angle that it covers, so all of the light is kept, a constant stays
    itself, and the brightest lamp is as bright as its texels allow.
    """
    if len(panorama) == height:
        return np.asarray(panorama, dtype=np.float32)
    old, new = len(panorama), height
    rows = _shares(-np.cos(np.linspace(0, math.pi, old + 1)), -np.cos(np.linspace(0, math.pi, new + 1)))
    columns = _shares(np.linspace(0, 1, 2 * old + 1), np.linspace(0, 1, 2 * new + 1))
    channels = panorama.shape[2]
    narrow = (rows @ panorama.reshape(old, -1).astype(np.float64)).reshape(new, 2 * old, channels)
    across = columns @ np.moveaxis(narrow, 1, 0).reshape(2 * old, -1)
    return np.ascontiguousarray(np.moveaxis(across.reshape(2 * new, new, channels), 0, 1), dtype=np.float32)


def for_envmap(panorama: NDArray[Any]) -> NDArray[np.float32]:
    """The image (2·H + 1, 2·H, C) that an `envmap` of Mitsuba reads as this panorama (H, 2·H, C).

    Mitsuba interpolates between texels, and lays its first row on the zenith and its last one on the nadir, not half a
    row away from them: H rows would be stretched by up to half a texel. Of the rows made here every other one lies on
    the middle of a texel, so that it has its own value there.
    """
    rows = len(panorama)
    image = np.empty((2 * rows + 1, *panorama.shape[1:]), dtype=np.float32)
    image[1::2] = panorama
    image[2:-1:2] = (image[1:-2:2] + image[3::2]) / 2
    image[0], image[-1] = panorama[0], panorama[-1]
    return image


def _shares(old: NDArray[np.float64], new: NDArray[np.float64]) -> sparse.csr_array:
    """(new, old) how much of each new interval each old one makes up, from their edges, which rise."""
    upper = np.minimum(old[1:], new[1:, None])
    lower = np.maximum(old[:-1], new[:-1, None])
    overlap = np.maximum(upper - lower, 0.0)
    return sparse.csr_array(overlap / overlap.sum(axis=1, keepdims=True))
