"""Surfaces of a frame that is being rendered, as tensors that stay on the device."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi
import torch
from torch import Tensor

from gibench.baselines.image_to_image.frames import Images
from gibench.rendering.backend import torch_device
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.channels import SETS
from gibench.rendering.gbuffer import surface_arrays
from gibench.rendering.replay import Replay, camera_arrays
from gibench.rendering.scene import Scene


def as_image(values: Any, resolution: tuple[int, int], grid: int = 1) -> Tensor:
    """Lanes of a grid (width, height) as (C, H, W) float32 on their device, each pixel the mean of grid × grid."""
    width, height = resolution
    parts = list(values) if dr.depth_v(values) > 1 else [values]
    # A constant has one lane.
    lanes = torch.stack([mi.Float(part).torch().expand(width * height) for part in parts])
    return lanes.reshape(-1, height // grid, grid, width // grid, grid).mean(dim=(2, 4))


def channels_first(image: Any) -> Tensor:
    """An image (H, W, C), mi.TensorXf or of NumPy, as (C, H, W) on the renderer's device."""
    tensor = image.torch() if isinstance(image, mi.TensorXf) else torch.from_numpy(image)
    return tensor.to(torch_device()).movedim(-1, 0)


class DeviceFrames:
    """Surface channels of the frames of a scene, by name, as `Frames` has them of files."""

    def __init__(self, scene: Scene, channels: Sequence[str]) -> None:
        """channels: of the sets surface, reflection, curvature and lighting (the direction of light)."""
        wanted = tuple(channels)
        held = [] if set(SETS["curvature"]).isdisjoint(wanted) else [scene.curvature.arrays]
        self._kernel = Replay(scene, partial(surface_arrays, scene, wanted), *held)

    def read(self, camera: PinholeCamera, resolution: tuple[int, int]) -> Images:
        """Those of a frame (width, height), point-sampled at pixel centres, in world space."""
        width, height = resolution
        across = dr.opaque(mi.UInt32, width)  # one kernel for all sizes
        found = self._kernel(camera_arrays(camera, resolution), across, width * height)
        return {name: as_image(values, resolution) for name, values in found.items()}
