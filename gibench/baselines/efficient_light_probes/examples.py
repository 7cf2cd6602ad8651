"""Examples for the reconstruction network: training views as the method sees them, and as they are.

Only the stills have a ground truth. The frames that come before them on a path do not exist, so the camera is moved
back along a line, once for each earlier frame that an input or the temporal loss looks at.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from gibench.baselines.efficient_light_probes.temporal import DECAY
from gibench.baselines.method import MethodError, Site
from gibench.baselines.stages import Stages
from gibench.baselines.training.crops import Window
from gibench.datasets.loading import Frame
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.gbuffer import render_gbuffer

STEP = (0.01, 0.08)
"""Way of the camera between two frames, over the median depth of the view. Walks of the preset `cpu` have .038 to
.067."""

TURN = math.radians(5.0)
"""Standard deviation of what the camera turns by between two frames. On the same walks it turns by 6 to 7° a frame."""

Inputs = Callable[[PinholeCamera, tuple[int, int], Stages], tuple[Tensor, Tensor, dict[str, float]]]


@dataclass(frozen=True)
class Example:
    """A training view, on the CPU, (C, H, W) float32.

    color: radiance that the method finds, the frames before it added. guides: depth (m), normal, albedo, reflected
    albedo. truth: radiance. before, guides_before: the same of the frame before; motion (2) in pixels to it, valid (1)
    where it saw the same point. These four are empty (0, H, W) without temporal parts.
    """

    color: Tensor
    guides: Tensor
    truth: Tensor
    before: Tensor
    guides_before: Tensor
    motion: Tensor
    valid: Tensor

    def cropped(self, window: Window) -> Example:
        """The same of a window of the image."""
        return Example(**{field.name: window.of(getattr(self, field.name)) for field in fields(self)})


def cameras_before(
    camera: PinholeCamera, depth: float, count: int, rng: np.random.Generator
) -> list[PinholeCamera]:
    """Cameras of 1, 2 … count frames ago, on a line in a random direction of the ground, turning steadily.

    depth: median depth of the view, metres.
    """
    heading = rng.uniform(0, 2 * math.pi)
    way = depth * rng.uniform(*STEP) * np.array([math.cos(heading), math.sin(heading), 0.0])
    turn = float(np.clip(rng.normal(0, TURN), -2 * TURN, 2 * TURN))
    position = np.asarray(camera.position)
    forward = np.asarray(camera.target) - position
    found = []
    for k in range(1, count + 1):
        place = position - k * way
        up = None if camera.up is None else tuple(_turned(np.array(camera.up), k * turn))
        target = tuple(place + _turned(forward, k * turn))
        found.append(replace(camera, position=tuple(place), target=target, up=up))
    return found


def _turned(vector: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """A vector (3,) about Z, radians."""
    sine, cosine = math.sin(angle), math.cos(angle)
    x, y, z = vector
    return np.array([cosine * x - sine * y, sine * x + cosine * y, z])


def examples(
    site: Site, inputs: Inputs, forget: Callable[[], None], *, temporal: bool, seed: int
) -> list[Example]:
    """Examples of all training views, in their order.

    inputs: the next frame of a path, forget: which begins another. temporal: whether there are frames before. Raises
    MethodError where there are fewer than two views.
    """
    if len(site.training) < 2:
        raise MethodError(
            f"elp learns from one training view and stops by another, but {site.folder} has {len(site.training)}: "
            "ask for more `views` in the track's preset"
        )
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,)))
    return [_example(site, frame, inputs, forget, temporal, rng) for frame in site.training]


def _example(
    site: Site,
    frame: Frame,
    inputs: Inputs,
    forget: Callable[[], None],
    temporal: bool,
    rng: np.random.Generator,
) -> Example:
    truth = _tensor(frame["color"])
    height, width = truth.shape[1:]
    resolution = (width, height)
    camera = frame.camera

    def view_of(one: PinholeCamera) -> tuple[Tensor, Tensor]:
        color, guides, _ = inputs(one, resolution, Stages())
        return color.cpu(), guides.cpu()

    forget()
    if not temporal:
        nothing = truth.new_zeros((0, height, width))
        return Example(*view_of(camera), truth, nothing, nothing, nothing, nothing)
    depth = render_gbuffer(site.scene, camera, resolution, ["depth"])["depth"]
    hit = depth[depth > 0]
    earlier = cameras_before(camera, float(np.median(hit)) if hit.size else 1.0, 1 + len(DECAY), rng)
    moved = render_gbuffer(
        site.scene, camera, resolution, ["motion", "motion_valid"], previous_camera=earlier[0]
    )
    for one in reversed(earlier[1:]):
        view_of(one)
    before, guides_before = view_of(earlier[0])
    motion, valid = _tensor(moved["motion"]), _tensor(moved["motion_valid"])
    return Example(*view_of(camera), truth, before, guides_before, motion, valid)


def _tensor(image: NDArray[Any]) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(np.moveaxis(image, -1, 0), dtype=np.float32))
