"""Area lights anywhere in a room, one by one or moving smoothly: what the track `moving-light` is lit by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from gibench.generators.layouts.placement import RejectedRoom
from gibench.generators.light import radiance_of, sample_kelvin
from gibench.generators.light_space import (
    CLEARANCE,
    COARSE,
    FINE,
    LARGEST_IN_VIEW,
    LightSpace,
    empty,
    in_ball,
    share_of_view,
)
from gibench.generators.parts import FloatArray, Light
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import AreaLight

if TYPE_CHECKING:
    from gibench.generators.parts import Camera

SIDES = (0.2, 1.5)
"""Of a light, m."""

LUMENS = (1000.0, 6000.0)

BATCH, BATCHES = 16, 16
"""Candidates that are checked at once, and how often before a room is given up."""

PATH_TRIES = 64
"""Curves before a room is given up."""

KNOTS = 3
"""Places that a light moves through."""

DENSE = 400
"""Points by which the length of a way is measured."""

LEAST_LENGTH = 0.8
"""Of a light's way, m."""

LARGEST_TURN = np.radians(120.0)
"""Between a moving light at two of its places, radians."""


class NoPlaceForLight(RejectedRoom):
    """A room in whose free space no area light was found a place for."""


def area_light(
    centre: Sequence[float] | FloatArray,
    rotation: Rotation,
    width: float,
    height: float,
    lumens: float,
    kelvin: float,
) -> AreaLight:
    """A rectangle that shines along +z of its frame, with its width along x and its height along y.

    centre: m. rotation: from its frame to the world. width, height: m. lumens: of all of it; kelvin: its colour, in
    [1000, 25000]. Raises BadLight, LightingError.
    """
    axes = rotation.as_matrix()
    x, y, z = (float(c) for c in centre)
    direction = (float(axes[0, 2]), float(axes[1, 2]), float(axes[2, 2]))
    bought = Light("area light", "rectangle", (width, height), (x, y, z), direction, lumens, kelvin)
    up = (float(axes[0, 1]), float(axes[1, 1]), float(axes[2, 1]))
    return AreaLight((x, y, z), direction, width, height, radiance_of(bought), up)


def sample_area_light(
    rng: np.random.Generator,
    space: LightSpace,
    *,
    cameras: Sequence[PinholeCamera | Camera] = (),
    aspect: float = 1.0,
    **fixed: Any,
) -> AreaLight:
    """A rectangle anywhere in the free space, 0.2 m or more from everything, that shines in any direction.

    Sides from 0.2 to 1.5 m, 1000 to 6000 lm, a colour that shops sell. cameras: in whose images (`aspect` is width over
    height) it covers no more than LARGEST_IN_VIEW. fixed: arguments of `area_light` that are not drawn.

    Raises NoPlaceForLight when the tries run out.
    """
    for _ in range(BATCHES):
        lights = [_candidate(rng, space, fixed) for _ in range(BATCH)]
        lights = [light for light in lights if _leaves_view(light, cameras, aspect)]
        if (light := space.first_free(lights)) is not None:
            return light
    raise _no_place(f"{BATCH * BATCHES} places for an area light were tried")


def sample_area_light_path(
    rng: np.random.Generator,
    space: LightSpace,
    frames: int,
    *,
    cameras: Sequence[PinholeCamera | Camera] = (),
    aspect: float = 1.0,
    **fixed: Any,
) -> tuple[AreaLight, ...]:
    """One light at `frames` moments of a smooth motion, in equal steps along its way; it keeps its size and colour.

    cameras: one, or one a moment. Everything else as in `sample_area_light`.
    """
    if frames < 2:
        return (sample_area_light(rng, space, cameras=cameras, aspect=aspect, **fixed),) * frames
    for _ in range(PATH_TRIES):
        motion = _sample_motion(rng, space, fixed)
        if motion is None:
            continue
        lights = motion.at(frames)
        seen = [[camera] for camera in cameras] if len(cameras) == frames else [list(cameras)] * frames
        clear = all(_leaves_view(light, by, aspect) for light, by in zip(lights, seen, strict=True))
        # Cheap checks first: most ways fail them. The last one is that nothing thin lies between two moments.
        if (
            clear
            and empty(space.scene, motion.covering(), COARSE).all()
            and space.free(lights).all()
            and empty(space.scene, motion.covering(), FINE).all()
        ):
            return lights
    raise _no_place(f"{PATH_TRIES} ways of an area light were tried")


def _no_place(tried: str) -> NoPlaceForLight:
    return NoPlaceForLight("no place for an area light", f"{tried}, none in free space; leave this room out")


def _candidate(rng: np.random.Generator, space: LightSpace, fixed: dict[str, Any]) -> AreaLight:
    drawn = {"centre": space.sample_point(rng), "rotation": Rotation.random(rng=rng), **_bought(rng)}
    return area_light(**{**drawn, **fixed})


def _bought(rng: np.random.Generator) -> dict[str, float]:
    low, high = LUMENS
    return {
        "width": float(rng.uniform(*SIDES)),
        "height": float(rng.uniform(*SIDES)),
        "lumens": round(float(low * (high / low) ** rng.random()), 1),
        "kelvin": sample_kelvin(rng),
    }


@dataclass(frozen=True, eq=False)
class _Motion:
    """A smooth way of a light. curve, turn: place and rotation by time; time, length: a dense table of the way, m."""

    curve: CubicSpline
    turn: RotationSpline
    time: FloatArray
    length: FloatArray
    bought: dict[str, Any]

    def at(self, count: int) -> tuple[AreaLight, ...]:
        """The light at `count` moments, in equal steps along its way."""
        time = np.interp(np.linspace(0.0, self.length[-1], count), self.length, self.time)
        return tuple(
            area_light(**{"centre": centre, "rotation": rotation, **self.bought})
            for centre, rotation in zip(self.curve(time), self.turn(time), strict=True)
        )

    def covering(self) -> tuple[AreaLight, ...]:
        """The light so often that the boxes around it that must be empty overlap from each time to the next."""
        return self.at(int(np.ceil(self.length[-1] / CLEARANCE)) + 1)


def _sample_motion(rng: np.random.Generator, space: LightSpace, fixed: dict[str, Any]) -> _Motion | None:
    """A way through places that have room for the light; None where too few are found, or the way is short."""
    bought = {**_bought(rng), **fixed}
    rotation = Rotation.random(rng=rng)
    turns = [Rotation.from_rotvec(in_ball(rng, 1.0) * LARGEST_TURN / 2) * rotation for _ in range(BATCH)]
    lights = [area_light(**{"centre": space.sample_point(rng), "rotation": turn, **bought}) for turn in turns]
    likely = np.flatnonzero(empty(space.scene, lights, COARSE))[:KNOTS]
    if len(likely) < KNOTS:
        return None
    # Along the line between two of them, so that the curve has no hairpins.
    places = np.array([lights[k].centre for k in likely])
    order = np.argsort((places - places[0]) @ (places[1] - places[0]), kind="stable")
    places, likely = places[order], likely[order]
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    if steps.min() < CLEARANCE:
        return None
    time = np.concatenate([[0.0], np.cumsum(np.sqrt(steps))])
    curve = CubicSpline(time, places, bc_type="natural")
    dense = np.linspace(0.0, time[-1], DENSE)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve(dense), axis=0), axis=1))])
    if length[-1] < LEAST_LENGTH:
        return None
    turn = RotationSpline(time, Rotation.concatenate([turns[k] for k in likely]))
    return _Motion(curve, turn, dense, length, bought)


def _leaves_view(light: AreaLight, cameras: Sequence[PinholeCamera | Camera], aspect: float) -> bool:
    return all(share_of_view(light, camera, aspect) <= LARGEST_IN_VIEW for camera in cameras)
