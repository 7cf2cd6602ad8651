"""The method `ngi`: indirect light by a network, direct light by linearly transformed cosines."""

from __future__ import annotations

from collections.abc import Mapping

import torch

from gibench.baselines.image_to_image.frames import Frames, held_out, share_of
from gibench.baselines.linearly_transformed_cosines.implementation import area_light
from gibench.baselines.method import MethodError, Prediction, Setting, Site, Training, View, reading
from gibench.baselines.moving_light.lit_frames import LitFrames
from gibench.baselines.moving_light.measure import CODE, HELD_OUT, JUDGED, Measure, measured, unit_of
from gibench.baselines.neural_global_illumination import METHOD, SURFACE
from gibench.baselines.neural_global_illumination.inputs import CUED, assembled
from gibench.baselines.neural_global_illumination.network import FACING, INPUTS, NeuralGlobalIllumination
from gibench.baselines.neural_global_illumination.training import (
    Examples,
    Predicting,
    TrainingPlan,
    size_of,
)
from gibench.baselines.sources import digest
from gibench.baselines.stages import Stages
from gibench.baselines.training import artifacts
from gibench.baselines.training.checkpoints import Checkpoint
from gibench.rendering.backend import torch_device


class NeuralLight:
    """See `gibench.baselines.neural_global_illumination.METHOD`."""

    def __init__(self, settings: Mapping[str, Setting]) -> None:
        """settings: all knobs."""
        self.adjust(settings)

    def adjust(self, settings: Mapping[str, Setting]) -> None:
        """Take other settings that do not train."""
        self.settings = dict(settings)
        self._lighting = str(settings["lighting"])

    def train(self, training: Training) -> float:
        """Learn the room. Returns seconds that were spent before."""
        views = training.views
        learned, judged = held_out(views, HELD_OUT, JUDGED)
        learned = share_of(views, learned, float(self.settings["images"]))
        frames = Frames(views, METHOD.channels, learned)
        measure = measured(frames)
        plan = TrainingPlan.of(self.settings, training.seed, training.seconds)
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
        inputs = sum(INPUTS.values()) + FACING * (self._lighting == "facing")
        self.network = NeuralGlobalIllumination(size_of(self.settings), inputs)
        with reading("the trained network", site.weights):
            weights, facts = artifacts.kept(site.weights)
            self.network.load_state_dict(weights["network"])
            self.measure = Measure.of_facts(facts)
        self.network.eval().requires_grad_(False).to(torch_device())
        self._frames = LitFrames(site.scene, SURFACE, cues=self._lighting in CUED)

    def render(self, view: View, stages: Stages) -> Prediction:
        """Direct light and cues, then the network."""
        area = area_light(view, "ngi")
        frame = self._frames.read(view, area, self.settings, stages)
        with stages.stage("inference"), torch.inference_mode():
            inputs = assembled(frame.images, view.camera, area, self.measure, self._lighting)
            code = self.network(inputs[None])[0]
            unit = unit_of(area).to(code.device) * self.measure.indirect
            return frame.with_indirect(CODE.decode(code) * unit)
