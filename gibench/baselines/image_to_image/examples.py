"""What a step learns from: a window of a frame, or of its mirror image, brighter or darker than it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from gibench.baselines.image_to_image.camera_space import in_camera_space, mirrored
from gibench.baselines.image_to_image.frames import Frames, Images
from gibench.baselines.image_to_image.shading import CHANNELS, geometry
from gibench.baselines.image_to_image.units import Units
from gibench.baselines.training.crops import random_window

TRUTH = "indirect_diffuse"
"""Channel that is learned."""

READ = (*CHANNELS, TRUTH)
"""Channels of a training frame."""

STOPS = 2.0
"""A frame is at most that many stops brighter or darker than its mean says, where that is all that is known of it."""


class Examples:
    """Frames in camera space, how they are exposed, and the units of their light."""

    def __init__(self, frames: Frames, units: Units) -> None:
        """frames: with the channels READ."""
        self.frames, self.units = frames, units

    def __len__(self) -> int:
        """How many."""
        return len(self.frames)

    def __getitem__(self, index: int) -> Images:
        """READ of a frame (C, H, W), "exposure" (1, 1, 1) and "unit" (1 or 3, 1, 1)."""
        images = in_camera_space(self.frames[index], self.frames.camera(index))
        unit = self.units.of(images["direct_diffuse"], images["albedo"], self.frames.area_light(index))
        return {**images, "exposure": torch.full((1, 1, 1), self.frames.exposure(index)), "unit": unit}


def inputs_of(example: Images) -> Images:
    """direct, truth, albedo (3, H, W), radiance; geometry; exposure (1, 1, 1); unit (1 or 3, 1, 1). Of whole frames."""
    return {
        "direct": example["direct_diffuse"],
        "truth": example[TRUTH],
        "albedo": example["albedo"],
        "geometry": geometry(example),
        "unit": example["unit"],
        "exposure": example["exposure"],
    }


@dataclass(frozen=True)
class Draw:
    """Draws what a step sees of an example. crop: pixels along a side at most. stops: of exposure, up and down."""

    crop: int
    stops: float = STOPS

    def __call__(self, example: Any, random: np.random.Generator) -> Images:
        """As `inputs_of`, cut to a window.

        Units are those of the whole frame, as they are when it is rendered.
        """
        numbers = {name: example[name] for name in ("exposure", "unit")}
        images = {name: image for name, image in example.items() if name not in numbers}
        if random.random() < 0.5:
            images = mirrored(images)
        found = inputs_of({**images, **numbers})
        found["unit"] = found["unit"] * 2.0 ** random.uniform(-self.stops, self.stops)
        window = random_window(found["direct"].shape[-2:], self.crop, random)
        return {name: _cut(image, window) for name, image in found.items()}


def _cut(image: Tensor, window: Any) -> Tensor:
    return image if image.shape[-1] == 1 else window.of(image).contiguous()
