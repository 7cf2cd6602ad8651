"""Direct light and surfaces of frames that are being rendered, as tensors that stay on the device."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from gibench.baselines.image_to_image.device_frames import DeviceFrames, as_image
from gibench.baselines.image_to_image.frames import Images
from gibench.baselines.linearly_transformed_cosines.implementation import RectangleLight
from gibench.baselines.method import Prediction, Setting, View
from gibench.baselines.stages import Stages
from gibench.rendering.channels import CUES
from gibench.rendering.lighting import AreaLight
from gibench.rendering.scene import Scene


@dataclass(frozen=True)
class LitFrame:
    """A frame under direct light. images: its channels, (C, H, W), direct light and cues among them; cues that were not
    asked for are 0. emission: seen straight, (3, H, W).
    """

    images: Images
    emission: Tensor

    def with_indirect(self, indirect: Tensor) -> Prediction:
        """All light, with indirect radiance (3, H, W); what no camera ray hits reflects nothing."""
        indirect = torch.where((self.images["normal"] != 0).any(dim=0), indirect, 0)
        direct = self.images["direct_diffuse"] + self.images["direct_specular"]
        color = self.emission + direct + indirect
        return Prediction(color.movedim(0, -1), indirect=indirect.movedim(0, -1))


class LitFrames:
    """Those of a scene, by linearly transformed cosines."""

    def __init__(self, scene: Scene, surface: Sequence[str], *, cues: bool = False) -> None:
        """surface: channels of what is seen, `normal` among them. cues: whether radiance cues are wanted."""
        self._light = RectangleLight(scene, cues=cues)
        self._surfaces = DeviceFrames(scene, surface)

    def read(self, view: View, area: AreaLight, settings: Mapping[str, Setting], stages: Stages) -> LitFrame:
        """One of them. settings: those of `linearly_transformed_cosines.SHADOWS`."""
        grid = math.isqrt(int(settings["rays"]))
        fine = (view.resolution[0] * grid, view.resolution[1] * grid)
        lit = self._light.lit(view, area, fine, int(settings["shadow_rays"]), stages)
        with stages.stage("g-buffer"):
            images = self._surfaces.read(view.camera, view.resolution)
        with stages.stage("filtering"):
            images["direct_diffuse"] = as_image(lit.diffuse, fine, grid)
            images["direct_specular"] = as_image(lit.specular, fine, grid)
            for name in CUES:
                cue = lit.cues.get(name)
                images[name] = (
                    torch.zeros_like(images["direct_diffuse"]) if cue is None else as_image(cue, fine, grid)
                )
            return LitFrame(images, as_image(lit.emission, fine, grid))
