"""The method `ngi`: indirect light by a network, direct light by linearly transformed cosines."""

from __future__ import annotations

import math
from collections.abc import Mapping

import torch

from gibench.baselines.image_to_image.device_frames import DeviceFrames, as_image, torch_device
from gibench.baselines.image_to_image.frames import Frames, held_out
from gibench.baselines.linearly_transformed_cosines.implementation import RectangleLight, area_light
from gibench.baselines.method import MethodError, Prediction, Setting, Site, Training, View, reading
from gibench.baselines.neural_global_illumination import METHOD, SURFACE
from gibench.baselines.neural_global_illumination.inputs import CODE, Measure, assembled
from gibench.baselines.neural_global_illumination.network import NeuralGlobalIllumination
from gibench.baselines.neural_global_illumination.training import (
    Examples,
    Plan,
    Predicting,
    area_of,
    facts_of,
    size_of,
)
from gibench.baselines.sources import digest
from gibench.baselines.stages import Stages
from gibench.baselines.training import artifacts
from gibench.baselines.training.checkpoints import Checkpoint

HELD_OUT, JUDGED = 0.05, 8
"""Share of the training frames that is held out, and how many of these are looked at."""

MEASURED = 64
"""Training frames that decide what numbers are divided by."""


class NeuralLight:
    """See `gibench.baselines.neural_global_illumination.METHOD`."""

    def __init__(self, settings: Mapping[str, Setting]) -> None:
        """settings: all knobs."""
        self.adjust(settings)

    def adjust(self, settings: Mapping[str, Setting]) -> None:
        """Take other settings that do not train."""
        self.settings = dict(settings)
        self._shadow_rays = int(settings["shadow_rays"])
        self._grid = math.isqrt(int(settings["rays"]))
        self._lighting = str(settings["lighting"])

    def train(self, training: Training) -> float:
        """Learn the room. Returns seconds that were spent before."""
        views = training.views
        learned, judged = held_out(views, HELD_OUT, JUDGED)
        count = max(1, round(float(self.settings["images"]) * len(learned)))
        learned = [learned[k * len(learned) // count] for k in range(count)]
        frames = Frames(views, METHOD.channels, learned)
        few = min(MEASURED, count)
        some = [k * count // few for k in range(few)]
        measure = Measure.of_frames([(frames[k], area_of(frames, k)) for k in some])
        plan = Plan.of(self.settings, training.seed, training.seconds)
        apart = Examples(Frames(views, METHOD.channels, judged), measure, self._lighting)
        learner = Predicting(
            Examples(frames, measure, self._lighting),
            [apart[k] for k in range(len(apart))],
            plan,
            torch_device(),
        )
        names = METHOD.trained_settings(self.settings)
        owner = {"method": "ngi", "sources": digest(__name__), "views": views.sha256, **names}
        trained = learner.trained(Checkpoint(training.checkpoint, owner))
        artifacts.keep(training.folder, trained, **measure.facts())
        return trained.before

    def prepare(self, site: Site) -> None:
        """Read the network."""
        if site.weights is None:
            raise MethodError("ngi has not been trained: it needs the folder that `train` filled")
        self.network = NeuralGlobalIllumination(size_of(self.settings))
        with reading("the trained network", site.weights):
            weights, facts = artifacts.kept(site.weights)
            self.network.load_state_dict(weights["network"])
            self.measure: Measure = facts_of(facts)
        self.network.eval().requires_grad_(False).to(torch_device())
        self._light = RectangleLight(site.scene, cues=self._lighting == "all")
        self._surfaces = DeviceFrames(site.scene, SURFACE)

    def render(self, view: View, stages: Stages) -> Prediction:
        """Direct light and cues, then the network."""
        area = area_light(view, "ngi")
        fine = (view.resolution[0] * self._grid, view.resolution[1] * self._grid)
        lit = self._light.lit(view, area, fine, self._shadow_rays, stages)
        with stages.stage("g-buffer"):
            images = self._surfaces.read(view.camera, view.resolution)
        with stages.stage("inference"), torch.inference_mode():
            diffuse, specular, emission = (
                as_image(part, fine, self._grid) for part in (lit.diffuse, lit.specular, lit.emission)
            )
            images |= {"direct_diffuse": diffuse, "direct_specular": specular}
            for name in (name for name in METHOD.channels if name.startswith("radiance_cue")):
                cue = lit.cues.get(name)
                images[name] = torch.zeros_like(diffuse) if cue is None else as_image(cue, fine, self._grid)
            inputs = assembled(images, view.camera, area, self.measure, self._lighting)
            code = self.network(inputs[None])[0]
            unit = code.new_tensor(area.radiance)[:, None, None] * self.measure.indirect
            # What no camera ray hits reflects nothing.
            indirect = torch.where((images["normal"] != 0).any(dim=0), CODE.decode(code) * unit, 0)
            color = emission + diffuse + specular + indirect
            return Prediction(color.movedim(0, -1), indirect=indirect.movedim(0, -1))
