"""What a step learns from: a window of a frame, or of its mirror image, brighter or darker than it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from gibench.baselines.image_to_image.camera_space import in_camera_space, mirrored
from gibench.baselines.image_to_image.frames import Frames, Images
from gibench.baselines.image_to_image.shading import CHANNELS, geometry, median_depth
from gibench.baselines.image_to_image.units import Units
from gibench.baselines.training.crops import Window, random_window
from gibench.rendering.camera import PinholeCamera

TRUTH = "indirect_diffuse"
"""Channel that is learned."""

READ = (*CHANNELS, TRUTH)
"""Channels of a training frame."""

STOPS = 2.0
"""A frame is at most that many stops brighter or darker than its mean says, where that is all that is known of it."""


@dataclass(frozen=True)
class Example:
    """A frame that is learned from. images: READ (C, H, W), in world space. camera: that sees them.

    exposure: (1, 1, 1). unit: of its light, (1 or 3, 1, 1). length: its median depth, (1, 1, 1).
    """

    images: Images
    camera: PinholeCamera
    exposure: Tensor
    unit: Tensor
    length: Tensor


class Examples:
    """Frames, how they are exposed, and the units of their light."""

    def __init__(self, frames: Frames, units: Units) -> None:
        """frames: with the channels READ."""
        self.frames, self.units = frames, units

    def __len__(self) -> int:
        """How many."""
        return len(self.frames)

    def __getitem__(self, index: int) -> Example:
        """Read one."""
        images = self.frames[index]
        return Example(
            images,
            self.frames.camera(index),
            torch.full((1, 1, 1), self.frames.exposure(index)),
            self.units.of(images["direct_diffuse"], images["albedo"], self.frames.area_light(index)),
            median_depth(images["depth"]),
        )


def inputs_of(example: Example, window: Window | None = None, *, mirror: bool = False) -> Images:
    """direct, truth, albedo (3, H, W), radiance; geometry; exposure (1, 1, 1); unit (1 or 3, 1, 1).

    window: what is left of the frame, all by default. mirror: whether it is one of the frame's mirror image. Units are
    those of the whole frame, as they are when it is rendered.
    """
    images = example.images
    if window is not None:
        if mirror:
            left = images["depth"].shape[-1] - window.width - window.left
            window = window._replace(left=left)
        images = {name: window.of(image) for name, image in images.items()}
    images = in_camera_space(images, example.camera)
    if mirror:
        images = mirrored(images)
    return {
        "direct": images["direct_diffuse"].contiguous(),
        "truth": images[TRUTH].contiguous(),
        "albedo": images["albedo"].contiguous(),
        "geometry": geometry(images, example.length),
        "unit": example.unit,
        "exposure": example.exposure,
    }


@dataclass(frozen=True)
class Draw:
    """Draws what a step sees of an example. crop: pixels along a side at most. stops: of exposure, up and down."""

    crop: int
    stops: float = STOPS

    def __call__(self, example: Any, random: np.random.Generator) -> Images:
        """As `inputs_of`, of a window, which is cut before anything is done with its pixels."""
        mirror = random.random() < 0.5
        exposed = 2.0 ** random.uniform(-self.stops, self.stops)
        window = random_window(example.images["depth"].shape[-2:], self.crop, random)
        found = inputs_of(example, window, mirror=mirror)
        return {**found, "unit": found["unit"] * exposed}
