"""The method `cnnr`: light told by three path-traced images, which every frame pays for, and a network for all else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from gibench.baselines.compositional_scene_representations import METHOD
from gibench.baselines.compositional_scene_representations.network import Represented
from gibench.baselines.compositional_scene_representations.observations import (
    LARGEST,
    Observed,
    observers,
    pose,
)
from gibench.baselines.compositional_scene_representations.training import (
    Example,
    Examples,
    Representing,
    TrainingPlan,
    described,
)
from gibench.baselines.image_to_image.frames import Frames, held_out
from gibench.baselines.linearly_transformed_cosines.implementation import area_light
from gibench.baselines.method import MethodError, Prediction, Setting, Site, View, reading
from gibench.baselines.moving_light import SURFACE
from gibench.baselines.moving_light.lit_frames import LitFrames
from gibench.baselines.moving_light.measure import HELD_OUT, JUDGED, Measure, area_of, measured, unit_of
from gibench.baselines.sources import digest
from gibench.baselines.stages import Stages
from gibench.baselines.training import artifacts
from gibench.baselines.training.checkpoints import Checkpoint
from gibench.baselines.training_set import TrainingSet
from gibench.rendering.backend import torch_device
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import Lighting

LIGHT = "light.npy"


class RepresentedLight:
    """See `gibench.baselines.compositional_scene_representations.METHOD`."""

    def __init__(self, settings: Mapping[str, Setting]) -> None:
        """settings: all knobs."""
        self.adjust(settings)

    def adjust(self, settings: Mapping[str, Setting]) -> None:
        """Take other settings that do not train."""
        self.settings = dict(settings)

    def prepare(self, site: Site) -> None:
        """Observe the light of all training frames, and learn from them; or find what was learned."""
        views = site.training
        if not isinstance(views, TrainingSet) or site.rig is None:
            raise MethodError("cnnr learns from frames under area lights: run it on the track moving-light")
        frames = Frames(views, METHOD.channels)
        learned, judged = held_out(views, HELD_OUT, JUDGED)
        measure = measured(Frames(views, METHOD.channels, learned))
        cameras = observers([frames.camera(number) for number in learned], measure)
        self.observe(site, cameras, measure)
        names = METHOD.baked_settings(self.settings)
        key = {"views": views.sha256, "observed": self.settings["observed"], "max_depth": site.max_depth}
        seen = site.bakes.get("observations", key, lambda folder: self._observed_all(site, frames, folder))
        with reading("the observations", seen.folder):
            light = torch.from_numpy(np.load(seen.folder / LIGHT))
        plan = TrainingPlan.of(self.settings, site.seed, site.seconds)

        def make(folder: Path) -> float:
            of = [
                Examples(Frames(views, METHOD.channels, numbers), light[numbers], measure)
                for numbers in (learned, judged)
            ]
            apart: list[Example] = [of[1][k] for k in range(len(judged))]
            poses = torch.stack([pose(camera, measure) for camera in cameras])
            learner = Representing(of[0], apart, self.observed.fixed(measure), poses, plan, torch_device())
            owner = {"method": "cnnr", "sources": digest(__name__), "views": views.sha256, **names}
            trained = learner.trained(Checkpoint(site.bakes.checkpoint(folder), owner))
            artifacts.keep(folder, trained, **measure.facts())
            return trained.before

        settings = {**key, **names, "seed": site.seed, "seconds": site.seconds}
        bake = site.bakes.get("training", settings, make)
        with reading("the trained network", bake.folder):
            weights, facts = artifacts.kept(bake.folder)
            network = Represented(plan.size)
            network.load_state_dict(weights["network"])
            self.measure = Measure.of_facts(facts)
        self.use(network)

    def observe(self, site: Site, cameras: Sequence[PinholeCamera], measure: Measure) -> None:
        """Begin to observe a site."""
        self.measure = measure
        self.observed = Observed(site.scene, cameras, site.max_depth, int(self.settings["observed"]))
        self._frames = LitFrames(site.scene, SURFACE)

    def use(self, network: Represented) -> None:
        """Take a network."""
        self.network = network.eval().requires_grad_(False).to(torch_device())

    def _observed_all(self, site: Site, frames: Frames, folder: Path) -> None:
        """Those of all frames, in half precision."""
        assert site.rig is not None
        found: list[Tensor] = []
        before = site.rig.lighting
        for index in range(len(frames)):
            area = area_of(frames, index)
            site.rig.set(Lighting(area=area))
            found.append(self.observed.light(area, self.measure, index).half().cpu())
        site.rig.set(before or Lighting())
        np.save(folder / LIGHT, torch.stack(found).numpy())

    def render(self, view: View, stages: Stages) -> Prediction:
        """Direct light, the three observations, then the networks."""
        area = area_light(view, "cnnr")
        frame = self._frames.read(view, area, self.settings, stages)
        with stages.stage("observations"):
            light = self.observed.light(area, self.measure, view.seed)
        with stages.stage("inference"), torch.inference_mode():
            pixels = described(frame.images, view.camera, self.measure)
            code = self.network(light[None], pixels[None])[0].clamp(0, np.log1p(LARGEST))
            unit = unit_of(area).to(code.device) * self.measure.indirect
            return frame.with_indirect(torch.expm1(code) * unit)
