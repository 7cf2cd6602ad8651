"""Drawing parameters of furniture at random, and judging those that a caller gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gibench.errors import GibenchError


class FurnitureError(GibenchError):
    """A family, style or size that cannot be built."""


@dataclass(frozen=True)
class Size:
    """A number that varies as a Gaussian around `median` and is clipped to [low, high].

    deviation: standard deviation as a share of the median. Metres, unless a family says otherwise.
    """

    median: float
    low: float
    high: float
    deviation: float = 0.09


def draw(
    rng: np.random.Generator, sizes: Mapping[str, Size], choices: Mapping[str, Sequence[Any]]
) -> dict[str, Any]:
    """One value for every size (a clipped Gaussian, to a tenth of a millimetre) and every choice
    (uniform)."""
    drawn: dict[str, Any] = {}
    for name, size in sizes.items():
        value = rng.normal(size.median, size.deviation * size.median)
        drawn[name] = round(float(np.clip(value, size.low, size.high)), 4)
    for name, options in choices.items():
        drawn[name] = options[int(rng.integers(len(options)))]
    return drawn


def checked(
    family: str, given: Mapping[str, Any], sizes: Mapping[str, Size], choices: Mapping[str, Sequence[Any]]
) -> dict[str, Any]:
    """The given parameters as a plain dict, once each is found in its bounds or among its options.

    Raises FurnitureError that names the family, the parameter, the value and what is allowed.
    """
    for name, size in sizes.items():
        value = given[name]
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not size.low <= value <= size.high
        ):
            raise FurnitureError(
                f"{family}: {name} must be a number from {size.low:g} to {size.high:g}, got {value!r}"
            )
    for name, options in choices.items():
        if given[name] not in options:
            allowed = (
                f"{options[0]} to {options[-1]}"
                if isinstance(options, range)
                else ", ".join(map(str, options))
            )
            raise FurnitureError(f"{family}: {name} must be one of {allowed}, got {given[name]!r}")
    return {name: given[name] for name in (*sizes, *choices)}
