"""The method `nfvr`: path-traced direct light, and indirect light by a network, wavelet by wavelet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from typing import Any, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from gibench.baselines.direct_light.tracer import DirectLight
from gibench.baselines.environments import environment_of
from gibench.baselines.first_hits import averaged
from gibench.baselines.image_to_image.device_frames import DeviceFrames
from gibench.baselines.image_to_image.frames import Frames, Images, held_out
from gibench.baselines.method import MethodError, Prediction, Setting, Site, Training, View, reading
from gibench.baselines.neural_free_viewpoint_relighting import METHOD, SURFACE
from gibench.baselines.neural_free_viewpoint_relighting.examples import Examples
from gibench.baselines.neural_free_viewpoint_relighting.inputs import Box, hit, surfaces
from gibench.baselines.neural_free_viewpoint_relighting.training import Relighting, TrainingPlan
from gibench.baselines.path_traced.tracer import GUIDES
from gibench.baselines.sources import digest
from gibench.baselines.stages import Stages
from gibench.baselines.training import artifacts
from gibench.baselines.training.checkpoints import Checkpoint
from gibench.baselines.training_set import TrainingSet
from gibench.baselines.wavelets.light import WaveletLight, chosen_light, coefficients_of
from gibench.baselines.wavelets.selection import Weighting
from gibench.rendering.backend import torch_device
from gibench.rendering.denoise import denoise

HELD_OUT, JUDGED = 0.05, 8
"""Share of the training frames that is held out, and how many of these are looked at."""

MEASURED = 64
"""Training frames that say how large the scene is."""


class NeuralRelighting(DirectLight):
    """See `gibench.baselines.neural_free_viewpoint_relighting.METHOD`."""

    def adjust(self, settings: Mapping[str, Setting]) -> None:
        """Take other settings that do not train."""
        super().adjust(settings)
        self.settings = dict(settings)
        self._wavelets = int(settings["wavelets"])
        self._selection = cast("Weighting", settings["selection"])

    def train(self, training: Training) -> float:
        """Learn the scene. Returns seconds that were spent before."""
        views = training.views
        learned, judged = held_out(views, HELD_OUT, JUDGED)
        plan = TrainingPlan.of(self.settings, training.seed, training.seconds)
        box = box_of(views, learned)
        examples, apart = (Examples(views, numbers, box, plan.faces) for numbers in (learned, judged))
        learner = Relighting(examples, apart, plan, torch_device())
        names = METHOD.trained_settings(self.settings)
        owner = {"method": "nfvr", "sources": digest(__name__), "views": views.sha256, **names}
        trained = learner.trained(Checkpoint(training.checkpoint, owner))
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
            raise MethodError("nfvr has not been trained: it needs the folder that `train` filled")
        plan = TrainingPlan.of(self.settings, site.seed, None)
        self.network, self._faces = plan.network(), plan.faces
        with reading("the trained network", site.weights):
            weights, facts = artifacts.kept(site.weights)
            self.network.load_state_dict(weights["network"])
            self.box = Box.of_facts(facts)
        self.network.eval().requires_grad_(False).to(torch_device())
        self._surfaces = DeviceFrames(site.scene, SURFACE)
        self._scored = set(site.parts)
        self._coefficients = lru_cache(maxsize=1)(partial(coefficients_of, faces=self._faces))

    def render(self, view: View, stages: Stages) -> Prediction:
        """Direct light, and the dot product of light and transport at every pixel that sees a surface."""
        environment = environment_of(view, "nfvr")
        with stages.stage("ray casting"):
            traced = self._traced(view)
            direct, *guides = (averaged(traced[name], view.resolution) for name in ("full", *GUIDES))
        with stages.stage("g-buffer"):
            images = self._surfaces.read(view.camera, view.resolution)
        with stages.stage("light"):
            light = chosen_light(self._coefficients(environment), self._wavelets, self._selection)
        with stages.stage("inference"), torch.inference_mode():
            indirect = self.indirect(images, view, light)
        with stages.stage("denoising"):
            return self._finished(np.asarray(direct), indirect, [np.asarray(guide) for guide in guides])

    def indirect(self, images: Images, view: View, light: WaveletLight) -> Tensor:
        """Indirect radiance (H, W, 3), ≥ 0, on the device; 0 where no surface is seen."""
        seen = hit(images)
        pixels = surfaces(images, view.camera, seen)
        places, weights = (torch.from_numpy(part).to(seen.device) for part in light)
        found = self.network.frame(self.box.inside(pixels.places), pixels.material, places, weights)
        image = found.new_zeros(*seen.shape, 3)
        image[seen] = found.clamp(min=0)
        return image

    def _finished(self, direct: NDArray[Any], indirect: Tensor, guides: Sequence[NDArray[Any]]) -> Prediction:
        """Denoise direct light, or all of the light and, where it is scored, indirect light once more."""
        made = indirect.cpu().numpy()
        albedo, normal = guides
        clean = partial(denoise, albedo=albedo, normal=normal)
        if not self._denoise:
            return Prediction(clean(direct) + made, indirect=made)
        return Prediction(clean(direct + made), indirect=clean(made) if "indirect" in self._scored else None)


def box_of(views: TrainingSet, numbers: Sequence[int]) -> Box:
    """The box of the places that some of the frames see."""
    count = min(MEASURED, len(numbers))
    some = [numbers[k * len(numbers) // count] for k in range(count)]
    frames = Frames(views, ("position", "normal"), some)
    read = (frames[index] for index in range(len(frames)))
    return Box.around(images["position"][:, hit(images)].T for images in read)
