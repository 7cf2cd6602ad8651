"""The environment in spherical harmonics: coefficients by exact integrals over texels, turned in closed form, windowed.

Coefficients are those of `gibench.baselines.training.encodings.spherical_harmonics`, in its order.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from gibench.baselines.training.encodings.spherical_harmonics import spherical_harmonics
from gibench.rendering.latlong import directions, resampled, solid_angles
from gibench.rendering.lighting import EnvironmentMap
from gibench.rendering.panoramas import HEIGHT, Panorama

DEGREE = 8
"""Of all light (Raghavan et al. 2023, Table 6): 81 coefficients."""

NODES = 6
"""Of Gauss-Legendre quadrature over the cosine of the polar angle in a row of texels."""

ROWS = 32
"""Of the panorama on which negative light is looked for."""

DUST = 1e-6
"""Of the largest coefficient: a smaller one is what rounding leaves of one that is not there."""


def count(degree: int) -> int:
    """How many harmonics there are up to a degree."""
    return (degree + 1) ** 2


def degrees(degree: int) -> NDArray[np.int64]:
    """(count,) degree of each harmonic."""
    return np.repeat(np.arange(degree + 1), 2 * np.arange(degree + 1) + 1)


def orders(degree: int) -> NDArray[np.int64]:
    """(count,) order m of each harmonic, from −l to l."""
    return np.concatenate([np.arange(-band, band + 1) for band in range(degree + 1)])


def projected(pixels: NDArray[Any], degree: int = DEGREE) -> NDArray[np.float64]:
    """(count, C) coefficients of a panorama (H, 2·H, C) whose texels are constant: ∫ radiance · Y dω.

    A constant has the first one alone. What is smaller than DUST of the largest is 0.
    """
    values = resampled(pixels, min(len(pixels), HEIGHT)).astype(np.float64)
    rows, columns = _integrals(len(values), degree)
    around = np.einsum("mx,yxc->ymc", columns, values)
    found = np.einsum("iy,yic->ic", rows, around[:, degree + orders(degree)])
    found[np.abs(found) <= DUST * np.abs(found).max(initial=0.0)] = 0
    return np.asarray(found)


@lru_cache(maxsize=8)
def _integrals(height: int, degree: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Of what depends on the polar angle, over rows, (count, H); of cos mφ and sin |m|φ, over columns, (2·degree + 1,
    2·H), from m = −degree.
    """
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    edges = np.cos(np.linspace(0, np.pi, height + 1))
    middle, half = (edges[:-1] + edges[1:]) / 2, (edges[:-1] - edges[1:]) / 2
    cosine = middle[:, None] + half[:, None] * nodes
    meridian = np.stack([np.sqrt(1 - cosine**2), np.zeros_like(cosine), cosine], axis=-1)
    basis = spherical_harmonics(torch.from_numpy(meridian), degree).numpy()
    bands, m = degrees(degree), orders(degree)
    basis = basis[..., bands**2 + bands + np.abs(m)]  # of −m as of m: the azimuth is apart
    rows = np.einsum("ykj,k,y->jy", basis, weights, half)
    # The azimuth falls from π/2 on (`latlong`).
    azimuth = np.pi / 2 - np.arange(2 * height + 1) * (np.pi / height)
    columns = np.empty((2 * degree + 1, 2 * height))
    for order in range(-degree, degree + 1):
        size = abs(order)
        if order > 0:
            through = np.sin(size * azimuth) / size
        elif order < 0:
            through = -np.cos(size * azimuth) / size
        else:
            through = azimuth
        columns[degree + order] = through[:-1] - through[1:]
    return rows, columns


def turned(coefficients: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Coefficients (count, C) of what is turned about Z by an angle, radians, left as seen from above.

    A whole turn gives the same bits.
    """
    degree = int(np.sqrt(len(coefficients))) - 1
    bands, m = degrees(degree), orders(degree)
    angle = float(np.mod(angle / (2 * np.pi), 1.0)) * 2 * np.pi
    partner = coefficients[bands**2 + bands - m]
    # Of cos mφ stands at m, of sin mφ at −m.
    return np.asarray(np.cos(m * angle)[:, None] * coefficients - np.sin(m * angle)[:, None] * partner)


@lru_cache(maxsize=64)
def _of_panorama(panorama: Panorama) -> NDArray[np.float64]:
    return projected(panorama.pixels)


def coefficients_of(environment: EnvironmentMap) -> NDArray[np.float64]:
    """(81, 3) of an environment as it is turned, W·m⁻²·sr⁻¹·sr^½."""
    return turned(_of_panorama(environment.panorama), environment.rotation)


def window(strength: float, degree: int) -> NDArray[np.float64]:
    """(count,) what coefficients are multiplied by: 1 / (1 + strength · l²(l + 1)²) (Sloan 2008, "Windowing").

    It is the least squares fit with a penalty on the squared Laplacian: the least curved light at a given distance.
    """
    bands = degrees(degree)
    return np.asarray(1 / (1 + strength * (bands * (bands + 1)) ** 2))


def negative_share(coefficients: NDArray[np.float64]) -> float:
    """Share of light that is negative: ∫ max(−L, 0) over ∫ |L|, over the sphere and the colours; 0 of no light.

    coefficients: (count, C) of L.
    """
    light = _over_sphere(int(np.sqrt(len(coefficients))) - 1) @ coefficients
    light *= np.repeat(solid_angles(ROWS), 2 * ROWS)[:, None]
    total = float(np.abs(light).sum())
    return float(np.maximum(-light, 0).sum()) / total if total > 0 else 0.0


@lru_cache(maxsize=8)
def _over_sphere(degree: int) -> NDArray[np.float64]:
    """(2·ROWS², count) harmonics in the middles of the texels of a panorama."""
    x, y = np.arange(2 * ROWS) + 0.5, (np.arange(ROWS) + 0.5)[:, None]
    basis = spherical_harmonics(torch.from_numpy(directions(x, y, ROWS)), degree)
    return np.asarray(basis.numpy().reshape(-1, count(degree)))
