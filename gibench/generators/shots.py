"""The light of every frame of a room: an area light or an environment, which moves where its sequence says so."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import TYPE_CHECKING, Protocol, TypeVar

import numpy as np

from gibench.generators.layouts.placement import RejectedRoom
from gibench.generators.parts import Camera, Room
from gibench.rendering.lighting import EnvironmentMap, Lighting, Shot
from gibench.rendering.panoramas import Panorama

if TYPE_CHECKING:
    from gibench.generators.imported.room import ImportedRoom
    from gibench.generators.light_space import LightSpace

LANE = 1001
"""Of the random numbers of lights, far above those that rooms draw from."""

TURN = math.radians(3.0)
"""Of an environment from one frame of a sequence to the next, left as seen from above."""

AnyRoom = TypeVar("AnyRoom", bound="Room | ImportedRoom")


class Lights(Protocol):
    """Source of the light of frames."""

    def one(self, rng: np.random.Generator, cameras: Sequence[Camera]) -> Lighting:
        """A lighting that the frames of these cameras share."""

    def moving(self, rng: np.random.Generator, cameras: Sequence[Camera]) -> tuple[Lighting, ...]:
        """One a camera, each a small step from the one before."""


@dataclass(frozen=True)
class Environments:
    """One of several panoramas, turned at random.

    rotations: how many turns a map may have that does not move, evenly around from none on; 0 for any.
    """

    panoramas: Sequence[Panorama]
    rotations: int = 0

    def one(self, rng: np.random.Generator, cameras: Sequence[Camera]) -> Lighting:
        """See `Lights`."""
        lighting = self.moving(rng, cameras[:1])[0]
        if not self.rotations:
            return lighting
        assert lighting.environment is not None
        turn = 2 * math.pi * int(rng.integers(self.rotations)) / self.rotations
        return Lighting(environment=replace(lighting.environment, rotation=turn))

    def moving(self, rng: np.random.Generator, cameras: Sequence[Camera]) -> tuple[Lighting, ...]:
        """See `Lights`. The environment turns."""
        panorama = self.panoramas[int(rng.integers(len(self.panoramas)))]
        start = float(rng.uniform(0, 2 * math.pi))
        return tuple(
            Lighting(environment=EnvironmentMap(panorama, (start + TURN * step) % (2 * math.pi)))
            for step in range(len(cameras))
        )


@dataclass(frozen=True)
class AreaLights:
    """Rectangles in free space. space: that of the room. aspect: of the images, width over height."""

    space: LightSpace
    aspect: float

    def one(self, rng: np.random.Generator, cameras: Sequence[Camera]) -> Lighting:
        """See `Lights`. Raises RejectedRoom where there is no place."""
        from gibench.generators.area_lights import sample_area_light

        return Lighting(sample_area_light(rng, self.space, cameras=cameras, aspect=self.aspect))

    def moving(self, rng: np.random.Generator, cameras: Sequence[Camera]) -> tuple[Lighting, ...]:
        """See `Lights`. Raises RejectedRoom where there is no way."""
        from gibench.generators.area_lights import sample_area_light_path

        lights = sample_area_light_path(rng, self.space, len(cameras), cameras=cameras, aspect=self.aspect)
        return tuple(Lighting(light) for light in lights)


def light_space(room: Room | ImportedRoom) -> LightSpace:
    """Space for the area lights of a room. Raises NoPlaceForLight, BackendError."""
    from gibench.rendering.backend import select_variant

    select_variant()  # before anything loads Mitsuba, so that it finds the right LLVM
    from gibench.generators.area_lights import NoPlaceForLight
    from gibench.generators.light_space import LightSpace, room_light_space
    from gibench.rendering.free_space import NoFreeSpace

    try:
        return room_light_space(room) if isinstance(room, Room) else LightSpace(room.scene.loaded, room.free)
    except NoFreeSpace:
        advice = "nothing is enclosed by a floor, a ceiling and walls; leave this room out"
        raise _named(room, NoPlaceForLight("no place for an area light", advice)) from None


def lit(room: AnyRoom, lights: Lights, moves: Mapping[str, str]) -> AnyRoom:
    """The room with a lighting for every camera.

    A still has one of its own; the frames of a path share one, or it moves. moves: "camera", "light" or "both", by the
    name of the path. The light of a still depends on the seed and its number alone, that of a path on its place among
    the paths. Raises RejectedRoom where an area light has no place or no way.
    """
    try:
        return replace(room, lightings=_lightings(room, lights, moves))
    except RejectedRoom as refusal:
        raise _named(room, refusal) from None


def _lightings(room: Room | ImportedRoom, lights: Lights, moves: Mapping[str, str]) -> tuple[Lighting, ...]:
    lightings: list[Lighting] = []
    paths = 0
    for path, group in groupby(room.cameras, key=lambda camera: camera.path):
        cameras = tuple(group)
        if not path:
            for camera in cameras:
                lightings.append(lights.one(_rng(room, 0, len(lightings)), [camera]))
            continue
        rng = _rng(room, 1, paths)
        paths += 1
        if moves[path] == "camera":
            lightings += [lights.one(rng, cameras)] * len(cameras)
        else:
            lightings += lights.moving(rng, cameras)
    return tuple(lightings)


def _named(room: Room | ImportedRoom, refusal: RejectedRoom) -> RejectedRoom:
    """The refusal, which names the file where the room is one of several scenes."""
    if isinstance(room, Room):
        return refusal
    return type(refusal)(f"{room.scene.tree.file}: {refusal.reason}", refusal.advice)


def _rng(room: Room | ImportedRoom, *number: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(room.seed, spawn_key=(room.index, LANE, *number)))


def shot_of(room: Room | ImportedRoom, view: int) -> Shot:
    """The camera and the light of a frame of a room."""
    camera = room.cameras[view]
    lighting = room.lightings[view] if room.lightings else Lighting()
    return Shot(camera.pinhole, lighting)


def shot_before(room: Room | ImportedRoom, view: int) -> Shot | None:
    """That of the frame before it on its path; None for the first one and for stills."""
    camera = room.cameras[view]
    before = room.cameras[view - 1] if view > 0 and camera.path else None
    follows = before is not None and (before.path, before.step) == (camera.path, camera.step - 1)
    return shot_of(room, view - 1) if follows else None
