"""Methods whose frames are path-traced direct light, and indirect light that is worked out surface by surface."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from gibench.baselines.direct_light.tracer import DirectLight
from gibench.baselines.environments import environment_of
from gibench.baselines.first_hits import averaged
from gibench.baselines.image_to_image.device_frames import DeviceFrames
from gibench.baselines.image_to_image.frames import Images
from gibench.baselines.method import Method, Prediction, Setting, Site, View
from gibench.baselines.path_traced.tracer import GUIDES
from gibench.baselines.relighting import SURFACE
from gibench.baselines.relighting.examples import Light
from gibench.baselines.relighting.surfaces import Pixels, hit, surfaces
from gibench.baselines.stages import Stages
from gibench.rendering.denoise import denoise
from gibench.rendering.lighting import EnvironmentMap


class Relit(DirectLight):
    """A method with `DENOISED` among its knobs. A subclass says what indirect light surfaces send to the viewer."""

    method: ClassVar[Method]
    stage: ClassVar[str] = "inference"
    """In which indirect light is worked out."""

    def __init__(self, settings: Mapping[str, Setting]) -> None:
        """settings: all knobs of the method."""
        self.settings = dict(settings)
        super().__init__(settings)

    def adjust(self, settings: Mapping[str, Setting]) -> None:
        """Take other settings that need no preparation."""
        super().adjust(settings)
        self.settings = dict(settings)

    @abstractmethod
    def light_of(self, environment: EnvironmentMap) -> Light:
        """What is taken of an environment, linear in its radiance."""

    @abstractmethod
    def told(self, light: Light) -> Any:
        """What the light of all surfaces is made from, once a frame."""

    def numbers(self, view: View, light: Light, told: Any) -> dict[str, float]:
        """What is worth a column of the light of a frame, and of what was told of it.

        Asked for once a frame, in their order, after the clock has stopped.
        """
        return {}

    @abstractmethod
    def sent(self, pixels: Pixels, told: Any) -> Tensor:
        """Indirect radiance (N, 3), signed, that surfaces send to the viewer."""

    @staticmethod
    def parts_of(site: Site) -> list[str]:
        """Of what is traced, direct light as a whole."""
        return ["full"]

    def prepare(self, site: Site) -> None:
        """Make ready to trace direct light and to see surfaces."""
        super().prepare(site)
        self._surfaces = DeviceFrames(site.scene, SURFACE)
        self._scored = set(site.parts)
        self._last: tuple[EnvironmentMap, Light] | None = None

    def render(self, view: View, stages: Stages) -> Prediction:
        """Direct light, and what every pixel that sees a surface gets from other surfaces."""
        environment = environment_of(view, self.method.id)
        with stages.stage("ray casting"):
            traced = self._traced(view)
            direct, *guides = (averaged(traced[name], view.resolution) for name in ("full", *GUIDES))
        with stages.stage("g-buffer"):
            images = self._surfaces.read(view.camera, view.resolution)
        with stages.stage("light"), torch.inference_mode():
            # One that stays from frame to frame is taken once.
            if self._last is None or self._last[0] != environment:
                self._last = environment, self.light_of(environment)
            told = self.told(self._last[1])
        with stages.stage(self.stage), torch.inference_mode():
            signed = self.signed(images, view, told)
            indirect = signed.clamp(min=0)
        extra = partial(self._numbers, view, self._last[1], told, signed)
        with stages.stage("denoising"):
            return self._finished(
                np.asarray(direct), indirect, [np.asarray(guide) for guide in guides], extra
            )

    def _numbers(self, view: View, light: Light, told: Any, signed: Tensor) -> dict[str, float]:
        return {**self.numbers(view, light, told), "negative_indirect": negative_share(signed)}

    def signed(self, images: Images, view: View, told: Any) -> Tensor:
        """Indirect radiance (H, W, 3) on the device, before what is negative is cut off; 0 where no surface is seen."""
        seen = hit(images)
        pixels = surfaces(images, view.camera, seen)
        found = self.sent(pixels, told)
        image = found.new_zeros(*seen.shape, 3)
        image[seen] = found
        return image

    def _finished(
        self,
        direct: NDArray[Any],
        indirect: Tensor,
        guides: Sequence[NDArray[Any]],
        extra: Callable[[], Mapping[str, float]],
    ) -> Prediction:
        """Denoise direct light or all of the light, and where it is scored indirect light, outside of the clock."""
        made = indirect.cpu().numpy()
        albedo, normal = guides
        clean = partial(denoise, albedo=albedo, normal=normal)
        if not self._denoise:
            return Prediction(clean(direct) + made, indirect=made, extra=extra)
        scored = partial(clean, made) if "indirect" in self._scored else None
        return Prediction(clean(direct + made), indirect=scored, extra=extra)


def negative_share(signed: Tensor) -> float:
    """Share of radiance (…, 3) that is negative, ∫ max(−L, 0) / ∫ |L|, which no light is and no frame shows."""
    total = float(signed.abs().sum())
    return float((-signed).clamp(min=0).sum()) / total if total > 0 else 0.0
