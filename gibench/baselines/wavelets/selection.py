"""Which wavelets of an environment matter most: one list for all colours, as the methods that use them have it."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gibench.baselines.wavelets.haar import WaveletError, side_of, supports

Weighting = Literal["none", "root-area", "area"]

POWERS: dict[str, float] = {"none": 0.0, "root-area": 0.5, "area": 1.0}
"""Of the area of a wavelet's support that its coefficient is multiplied by before the largest are chosen.

|c| of an orthonormal transform keeps the most energy (Ng, Ramamoorthi and Hanrahan 2003, section 5: unweighted and
area-weighted selection).
"""


def largest(
    coefficients: NDArray[np.floating], count: int, weighting: Weighting = "none"
) -> NDArray[np.int64]:
    """(count,) places of the coefficients (…, S, S, C) that matter most, in the flat order of (…, S, S).

    Magnitudes are summed over the colours; the largest comes first, of equal ones that with the smaller place. Raises
    WaveletError for more than there are, and for an unknown weighting.
    """
    if weighting not in POWERS:
        raise WaveletError(f"no weighting '{weighting}': choose from {', '.join(POWERS)}")
    side = side_of(coefficients)
    magnitude = np.abs(coefficients).sum(axis=-1, dtype=np.float64) * supports(side) ** POWERS[weighting]
    if not 1 <= count <= magnitude.size:
        raise WaveletError(f"{count} wavelets of {magnitude.size}: choose from 1 to all")
    least_first = -magnitude.ravel()
    # Sorting those alone that can be among them takes a fraction of sorting all.
    last = np.partition(least_first, count - 1)[count - 1]
    within = np.flatnonzero(least_first <= last)
    return within[np.argsort(least_first[within], kind="stable")[:count]]


def energy_kept(coefficients: NDArray[np.floating], places: NDArray[np.int64]) -> float:
    """Share of the sum of squares of coefficients (…, S, S, C) that lies at places, in [0, 1]; 1 where all is 0."""
    energy = np.square(coefficients, dtype=np.float64).sum(axis=-1).ravel()
    total = float(energy.sum())
    return float(energy[places].sum()) / total if total > 0 else 1.0


def replaced(places: NDArray[np.int64], before: NDArray[np.int64]) -> float:
    """Share of the chosen wavelets that were not chosen before, in [0, 1]; 0 where none is chosen.

    A frame after the other under a light that turns, this is how much the selection flickers.
    """
    return float(np.isin(places, before, invert=True).mean()) if len(places) else 0.0


def only(coefficients: NDArray[np.floating], places: NDArray[np.int64]) -> NDArray[np.floating]:
    """The coefficients (…, S, S, C) with zeros but for some places."""
    flat = coefficients.reshape(-1, coefficients.shape[-1])
    kept = np.zeros_like(flat)
    kept[places] = flat[places]
    return kept.reshape(coefficients.shape)
