"""Cameras around a still life: all of them look at it, from above the ground, and see all of it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from gibench.generators.layouts.placement import RejectedRoom
from gibench.generators.parts import Camera, FloatArray
from gibench.generators.trajectories import NoFarView, Spread, spread_stills

FOV = (math.radians(34), math.radians(50))
ELEVATION = (math.radians(14), math.radians(52))
CLOSENESS = (0.88, 1.2)
"""Distance over that at which all of the things just fit into a square image."""

GOLDEN = math.pi * (3 - math.sqrt(5))
"""Between the azimuths of one still and the next, so that they lie far from each other, however many there are."""


BATCH = 24
"""Candidates for stills away from trajectories that are drawn at once."""

SPREAD_TRIES = 20
"""Sets of trajectories that are drawn before the still life is drawn again."""


def sample_stills(
    rng: np.random.Generator, middle: FloatArray, radius: float, count: int
) -> tuple[Camera, ...]:
    """Draw `count` single views of the things in a ball, (3,) and metres."""
    start = rng.uniform(0, 2 * math.pi)
    cameras = []
    for number in range(count):
        fov = float(rng.uniform(*FOV))
        azimuth = start + number * GOLDEN + float(rng.normal(0, 0.15))
        aim = middle + rng.normal(0, 0.06, 3) * radius
        place = _around(
            aim, radius, fov, azimuth, float(rng.uniform(*ELEVATION)), float(rng.uniform(*CLOSENESS))
        )
        cameras.append(_camera(place, aim, fov))
    return tuple(cameras)


def sample_spread(
    rng: np.random.Generator, middle: FloatArray, radius: float, count: int, spread: Spread
) -> tuple[Camera, ...]:
    """Draw `count` stills along walks around the things, and away from these.

    Raises RejectedRoom where the walks go all around, however often they are drawn.
    """

    def trajectory(frames: int) -> tuple[tuple[Camera, ...], Counter[str]]:
        return sample_path(rng, middle, radius, "walk", frames), Counter()

    def candidates() -> tuple[tuple[Camera, ...], Counter[str]]:
        return sample_stills(rng, middle, radius, BATCH), Counter()

    for _ in range(SPREAD_TRIES):
        with suppress(NoFarView):
            return spread_stills(count, spread, trajectory, candidates)[0]
    raise RejectedRoom("no view away from the trajectories")


def sample_path(
    rng: np.random.Generator, middle: FloatArray, radius: float, kind: str, count: int
) -> tuple[Camera, ...]:
    """Draw a smooth path of `count` views. kind: "walk", "orbit" or "eight", see `WAYS`."""
    fov, azimuth = float(rng.uniform(*FOV)), float(rng.uniform(0, 2 * math.pi))
    sign = 1.0 if rng.random() < 0.5 else -1.0
    first, last = (float(rng.uniform(*ELEVATION)) for _ in range(2))
    near, far = (float(rng.uniform(*CLOSENESS)) for _ in range(2))
    cameras = []
    for step, t in enumerate(np.linspace(0.0, 1.0, count, endpoint=kind != "eight")):
        turn, rise, approach = WAYS[kind](float(t))
        elevation, close = first + rise * (last - first), near + approach * (far - near)
        place = _around(middle, radius, fov, azimuth + sign * turn, elevation, close)
        cameras.append(_camera(place, middle, fov, kind, step))
    return tuple(cameras)


WAYS: dict[str, Callable[[float], tuple[float, float, float]]] = {
    "walk": lambda t: (1.6 * t, t, t),
    "orbit": lambda t: (math.pi * t, 0.0, 0.0),
    "eight": lambda t: (
        0.6 * math.sin(2 * math.pi * t),
        0.5 + 0.5 * math.sin(4 * math.pi * t),
        0.5,
    ),
}
"""Path → from t in [0, 1] the turn around the still life in radians, and how far elevation and distance have gone from
one end to the other: a walk changes all three, an orbit turns alone, an eight sways to both sides, up and down."""


def _around(
    aim: FloatArray, radius: float, fov: float, azimuth: float, elevation: float, closeness: float
) -> FloatArray:
    distance = closeness * radius / math.sin(fov / 2)
    flat = math.cos(elevation)
    towards = np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)])
    return np.asarray(aim + distance * towards)


def _camera(place: FloatArray, aim: FloatArray, fov: float, path: str = "", step: int = 0) -> Camera:
    position, target = ((float(p[0]), float(p[1]), float(p[2])) for p in (place, aim))
    return Camera(position, target, fov, path, step)
