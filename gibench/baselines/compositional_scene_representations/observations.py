"""Three images of the room with all of its light, path traced under the light of a frame.

Granskog et al. 2020 observe each scene from anywhere. Here the room stays, and so do the three cameras: of those that
took the training frames, each is farthest from the ones before it.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import torch
from torch import Tensor

from gibench.baselines.compositional_scene_representations.network import OBSERVATIONS, SIDE
from gibench.baselines.image_to_image.device_frames import DeviceFrames, as_image
from gibench.baselines.moving_light.measure import FARTHEST, Measure, per_flux
from gibench.baselines.path_traced.tracer import trace_rows
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import AreaLight
from gibench.rendering.replay import Replay, camera_arrays
from gibench.rendering.scene import Scene

LARGEST = 1e4
"""Of light, in units of its mean over the training frames."""


def observers(cameras: Sequence[PinholeCamera], measure: Measure) -> list[PinholeCamera]:
    """OBSERVATIONS of the cameras that are far from each other, in places and in where they look."""
    half = np.array(measure.half)
    where = np.array([[*(np.array(camera.position) / half), *camera.frame[2]] for camera in cameras])
    chosen = [0]
    distance = np.full(len(where), np.inf)
    for _ in range(OBSERVATIONS - 1):
        distance = np.minimum(distance, np.linalg.norm(where - where[chosen[-1]], axis=1))
        chosen.append(int(distance.argmax()))
    return [cameras[number] for number in chosen]


def pose(camera: PinholeCamera, measure: Measure) -> Tensor:
    """A camera as 16 numbers: its axes by row, its place in half sizes of the room, and (0, 0, 0, 1)."""
    matrix = np.eye(4)
    matrix[:3, :3] = camera.frame
    matrix[:3, 3] = (np.array(camera.position) - measure.centre) / measure.half
    return torch.from_numpy(matrix.astype(np.float32).ravel())


class Observed:
    """What three cameras see of a scene."""

    def __init__(self, scene: Scene, cameras: Sequence[PinholeCamera], max_depth: int, spp: int) -> None:
        """max_depth: scattering events of the paths. spp: of them a pixel."""
        self.scene, self.cameras, self.spp = scene, list(cameras), spp
        self.kernel = Replay(scene, partial(trace_rows, scene, max_depth, ()))

    def fixed(self, measure: Measure) -> Tensor:
        """Albedo, normal and distance, (OBSERVATIONS, 7, SIDE, SIDE)."""
        frames = DeviceFrames(self.scene, ("albedo", "normal", "distance"))
        size = max(measure.half)
        found = []
        for camera in self.cameras:
            images = frames.read(camera, (SIDE, SIDE))
            distance = (images["distance"] / size).clamp(max=2 * FARTHEST)
            found.append(torch.cat([images["albedo"], images["normal"], distance]))
        return torch.stack(found)

    def light(self, area: AreaLight, measure: Measure, seed: int) -> Tensor:
        """Light of the scene as it is lit now, log1p in units of its mean: (OBSERVATIONS, 3, SIDE, SIDE)."""
        found = []
        for number, camera in enumerate(self.cameras):
            drawn = int(np.random.SeedSequence(seed, spawn_key=(number,)).generate_state(1)[0])
            varying: list[Any] = [dr.opaque(mi.UInt32, value) for value in (drawn, 0, SIDE)]
            traced = self.kernel(camera_arrays(camera, (SIDE, SIDE)), *varying, SIDE * SIDE, self.spp)
            image = per_flux(as_image(traced["full"], (SIDE, SIDE)), area) / measure.indirect
            found.append(torch.log1p(image.clamp(0, LARGEST)))
        return torch.stack(found)
