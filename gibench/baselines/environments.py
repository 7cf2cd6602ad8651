"""Environments as methods read them that relight a scene."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.baselines.method import MethodError, View
from gibench.rendering.lighting import EnvironmentMap
from gibench.rendering.panoramas import Panorama

SMALLEST_SHIFT = 1e-6
"""Of a column: whole turns, which leave dust in double precision, move nothing."""


def environment_of(view: View, method: str) -> EnvironmentMap:
    """The environment of a view. Raises MethodError where there is none."""
    environment = view.shot.lighting.environment
    if environment is None:
        raise MethodError(
            f"{method} is for frames under an environment alone, and this one has {view.shot.lighting.kind} light: "
            "run it on the track relight"
        )
    return environment


def mean_radiance(panorama: Panorama) -> NDArray[np.float64]:
    """(3,), over the sphere."""
    return np.array(_mean(panorama))


@lru_cache(maxsize=256)
def _mean(panorama: Panorama) -> tuple[float, ...]:
    rows = panorama.pixels.mean(axis=1, dtype=np.float64)
    weight = np.sin(np.pi * (np.arange(len(rows)) + 0.5) / len(rows))
    return tuple((weight @ rows / weight.sum()).tolist())


def turned(panorama: NDArray[Any], rotation: float) -> NDArray[Any]:
    """The panorama (H, 2·H, C) that is seen when one is turned about Z by `rotation`, radians, left from above.

    Each texel has the mean of what it covers of the two that come to lie there. A whole turn gives the same bits.
    """
    columns = panorama.shape[1]
    shift = float(np.mod(rotation / (2 * np.pi), 1.0)) * columns
    whole = round(shift) if abs(shift - round(shift)) < SMALLEST_SHIFT else int(shift)
    part = shift - whole
    here = np.roll(panorama, -whole, axis=1)
    if abs(part) < SMALLEST_SHIFT:
        return here
    mixed = (1 - part) * here.astype(np.float64) + part * np.roll(here, -1, axis=1)
    return mixed.astype(panorama.dtype)
