"""Methods whose frames are path-traced direct light, and indirect light that a network says surface by surface."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from gibench.baselines.direct_light.tracer import DirectLight
from gibench.baselines.environments import environment_of
from gibench.baselines.first_hits import averaged
from gibench.baselines.image_to_image.device_frames import DeviceFrames
from gibench.baselines.image_to_image.frames import Images, held_out
from gibench.baselines.method import Method, MethodError, Prediction, Setting, Site, Training, View, reading
from gibench.baselines.path_traced.tracer import GUIDES
from gibench.baselines.relighting import SURFACE
from gibench.baselines.relighting.examples import Examples, Light, box_of
from gibench.baselines.relighting.learner import RelightingLearner
from gibench.baselines.relighting.surfaces import Box, hit, surfaces
from gibench.baselines.sources import digest
from gibench.baselines.stages import Stages
from gibench.baselines.training import artifacts
from gibench.baselines.training.budget import Budget
from gibench.baselines.training.checkpoints import Checkpoint
from gibench.baselines.training.loop import train
from gibench.baselines.training_set import TrainingSet
from gibench.rendering.backend import torch_device
from gibench.rendering.denoise import denoise
from gibench.rendering.lighting import EnvironmentMap

HELD_OUT, JUDGED = 0.05, 8
"""Share of the training frames that is held out, and how many of these are looked at."""


class RelitByNetwork(DirectLight):
    """A method with `DENOISED` among its knobs and `CHANNELS` as its channels. A subclass has the network."""

    method: ClassVar[Method]
    steps: ClassVar[int]
    """Of a training without a limit of seconds."""

    def __init__(self, settings: Mapping[str, Setting]) -> None:
        """settings: all knobs of the method."""
        self.settings = dict(settings)
        super().__init__(settings)

    def adjust(self, settings: Mapping[str, Setting]) -> None:
        """Take other settings that do not train."""
        super().adjust(settings)
        self.settings = dict(settings)

    def survey(self, views: TrainingSet, number: int, box: Box, folder: Path) -> None:
        """Make what the network stands on, beside its training, and leave it in a folder: nothing.

        number: of one of the views. box: of the places that they see.
        """

    def surveyed(self, folder: Path, box: Box) -> None:
        """Read that again."""

    @abstractmethod
    def untrained(self, seed: int) -> nn.Module:
        """The network."""

    @abstractmethod
    def learner(self, examples: Examples, apart: Examples, seed: int) -> RelightingLearner:
        """Of that network. apart: what is held out."""

    @abstractmethod
    def light_of(self, environment: EnvironmentMap) -> Light:
        """What is taken of an environment, linear in its radiance."""

    @abstractmethod
    def told(self, light: Light) -> Any:
        """What the network is told of light, once a frame."""

    def numbers(self, view: View, told: Any) -> dict[str, float]:
        """What is worth a column of the light that a frame was told of."""
        return {}

    @abstractmethod
    def radiance(self, points: Tensor, material: Tensor, told: Any) -> Tensor:
        """Indirect radiance (N, 3), signed, of surfaces at points (N, 3) of the unit cube, material (N, 13)."""

    def train(self, training: Training) -> float:
        """Learn the scene. Returns seconds that were spent before."""
        views = training.views
        learned, judged = held_out(views, HELD_OUT, JUDGED)
        box = box_of(views, learned)
        self.survey(views, learned[0], box, training.folder)
        examples, apart = (Examples(views, numbers, box, self.light_of) for numbers in (learned, judged))
        learner = self.learner(examples, apart, training.seed)
        names = self.method.trained_settings(self.settings)
        sources = digest(type(self).__module__)
        owner = {"method": self.method.id, "sources": sources, "views": views.sha256, **names}
        trained = train(
            learner,
            learner.batches(),
            Budget(steps=None if training.seconds else self.steps, seconds=training.seconds),
            seed=training.seed,
            checkpoint=Checkpoint(training.checkpoint, owner),
            title=self.method.id,
        )
        artifacts.keep(training.folder, trained, **box.facts())
        return trained.before

    @staticmethod
    def parts_of(site: Site) -> list[str]:
        """Of what is traced, direct light as a whole."""
        return ["full"]

    def prepare(self, site: Site) -> None:
        """Read the network."""
        super().prepare(site)
        if site.weights is None:
            raise MethodError(
                f"{self.method.id} has not been trained: it needs the folder that `train` filled"
            )
        with reading("the trained network", site.weights):
            weights, facts = artifacts.kept(site.weights)
            self.box = Box.of_facts(facts)
            self.surveyed(site.weights, self.box)
            network = self.untrained(site.seed)
            network.load_state_dict(weights["network"])
        self.network = network.eval().requires_grad_(False).to(torch_device())
        self._surfaces = DeviceFrames(site.scene, SURFACE)
        self._scored = set(site.parts)
        self._last: tuple[EnvironmentMap, Light] | None = None

    def render(self, view: View, stages: Stages) -> Prediction:
        """Direct light, and what the network says of every pixel that sees a surface."""
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
            extra = self.numbers(view, told)
        with stages.stage("inference"), torch.inference_mode():
            indirect = self.indirect(images, view, told)
        with stages.stage("denoising"):
            return self._finished(
                np.asarray(direct), indirect, [np.asarray(guide) for guide in guides], extra
            )

    def indirect(self, images: Images, view: View, told: Any) -> Tensor:
        """Indirect radiance (H, W, 3), ≥ 0, on the device; 0 where no surface is seen."""
        seen = hit(images)
        pixels = surfaces(images, view.camera, seen)
        found = self.radiance(self.box.inside(pixels.places), pixels.material, told)
        image = found.new_zeros(*seen.shape, 3)
        image[seen] = found.clamp(min=0)
        return image

    def _finished(
        self,
        direct: NDArray[Any],
        indirect: Tensor,
        guides: Sequence[NDArray[Any]],
        extra: Mapping[str, float],
    ) -> Prediction:
        """Denoise direct light, or all of the light and, where it is scored, indirect light once more."""
        made = indirect.cpu().numpy()
        albedo, normal = guides
        clean = partial(denoise, albedo=albedo, normal=normal)
        if not self._denoise:
            return Prediction(clean(direct) + made, indirect=made, extra=extra)
        scored = clean(made) if "indirect" in self._scored else None
        return Prediction(clean(direct + made), indirect=scored, extra=extra)
