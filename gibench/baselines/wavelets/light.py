"""Light of an environment as the few wavelets that a network is asked about."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gibench.baselines.environments import turned
from gibench.baselines.wavelets.haar import haar, supports
from gibench.baselines.wavelets.selection import Weighting, largest
from gibench.rendering.cubemap import to_cubemap
from gibench.rendering.lighting import EnvironmentMap

FAINT = 1e-6
"""Of the largest weight: a smaller one is what rounding leaves of a wavelet that is not there."""


class WaveletLight(NamedTuple):
    """Some wavelets and how much of each there is.

    places: (K,) of the coefficients (6, S, S) in flat order, int64. weights: (K, 3), W·m⁻², linear Rec. 709, signed:
    the coefficient times `scales`.
    """

    places: NDArray[np.int64]
    weights: NDArray[np.float32]


def coefficients_of(environment: EnvironmentMap, faces: int) -> NDArray[np.float64]:
    """(6, faces, faces, 3) Haar coefficients of an environment as it is turned, W·m⁻²·sr⁻¹."""
    pixels = turned(environment.panorama.pixels, environment.rotation)
    return haar(to_cubemap(pixels, faces).astype(np.float64))


def scales(faces: int) -> NDArray[np.float64]:
    """(faces, faces) by which coefficients are multiplied, sr, on texels of equal solid angle.

    A wavelet on A texels is ±1/√A there, so light of one radiance in it is √A. What reflects it changes little over a
    small support: of a smooth function the differences that a wavelet takes fall with the side of its support, by √A
    again. Times A, over the side of a face so that the coarsest have the integral of their magnitude, smooth transport
    answers to all levels with numbers of one size; and what a network was hardly ever asked about, and answers at
    random, weighs no more than it can be worth.
    """
    return supports(faces) / faces * (4 * np.pi / (6 * faces**2))


def weights_of(coefficients: NDArray[np.float64], places: NDArray[np.int64]) -> NDArray[np.float64]:
    """(K, 3) weights of some of the coefficients (6, S, S, 3), as `WaveletLight` has them."""
    size = scales(coefficients.shape[1]).ravel()
    return coefficients.reshape(-1, coefficients.shape[-1])[places] * size[places % size.size, None]


def light_at(coefficients: NDArray[np.float64], places: NDArray[np.int64]) -> WaveletLight:
    """The light in certain wavelets, whether there is any or not."""
    return WaveletLight(places, weights_of(coefficients, places).astype(np.float32))


def chosen_light(coefficients: NDArray[np.float64], count: int, weighting: Weighting) -> WaveletLight:
    """The light in the wavelets that matter most, `count` at most: none where there is no light.

    coefficients: (6, S, S, 3). weighting: one of `selection.POWERS`. Raises WaveletError.
    """
    found = light_at(coefficients, largest(coefficients, min(count, coefficients[..., 0].size), weighting))
    size = np.abs(found.weights).max(axis=1)
    kept = size > FAINT * size.max(initial=0.0)
    return WaveletLight(found.places[kept], found.weights[kept])
