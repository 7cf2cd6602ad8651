"""The method `rrf`: direct light by linearly transformed cosines, indirect light by networks of parts of the room."""

from __future__ import annotations

from collections.abc import Mapping

import torch

from gibench.baselines.image_to_image.frames import Frames, held_out
from gibench.baselines.linearly_transformed_cosines.implementation import area_light
from gibench.baselines.method import MethodError, Prediction, Setting, Site, Training, View, reading
from gibench.baselines.moving_light import SURFACE
from gibench.baselines.moving_light.lit_frames import LitFrames
from gibench.baselines.moving_light.measure import HELD_OUT, JUDGED, Measure, measured, unit_of
from gibench.baselines.radiance_regression import METHOD
from gibench.baselines.radiance_regression.network import FACING, PLACE, REST, CellNetworks
from gibench.baselines.radiance_regression.partition import Partition
from gibench.baselines.radiance_regression.training import (
    Regressing,
    all_points,
    described,
    points_of,
    predicted,
    room_of,
)
from gibench.baselines.sources import digest
from gibench.baselines.stages import Stages
from gibench.baselines.training import artifacts
from gibench.baselines.training.checkpoints import Checkpoint
from gibench.rendering.backend import torch_device

AT_ONCE = 1 << 19
"""Pixels of a frame that are computed before others."""


class RegressedLight:
    """See `gibench.baselines.radiance_regression.METHOD`."""

    def __init__(self, settings: Mapping[str, Setting]) -> None:
        """settings: all knobs."""
        self.adjust(settings)

    def adjust(self, settings: Mapping[str, Setting]) -> None:
        """Take other settings that do not train."""
        self.settings = dict(settings)
        self._facing = bool(settings["facing"])

    def train(self, training: Training) -> float:
        """Split the room and learn its parts. Returns seconds that were spent before."""
        views = training.views
        learned, judged = (
            Frames(views, METHOD.channels, numbers) for numbers in held_out(views, HELD_OUT, JUDGED)
        )
        measure = measured(learned)
        points = all_points(learned, measure, training.seed, self._facing)
        partition = room_of(points, int(self.settings["cells"]))
        most = 1 << 62
        apart = [points_of(judged, k, measure, most, training.seed, self._facing) for k in range(len(judged))]
        learner = Regressing(
            points, partition, apart, seed=training.seed, seconds=training.seconds, device=torch_device()
        )
        names = METHOD.trained_settings(self.settings)
        owner = {"method": "rrf", "sources": digest(__name__), "views": views.sha256, **names}
        trained = learner.trained(Checkpoint(training.checkpoint, owner))
        trained.weights["partition"] = partition.tensors()
        artifacts.keep(training.folder, trained, **measure.facts())
        return trained.before

    def prepare(self, site: Site) -> None:
        """Read the networks."""
        if site.weights is None:
            raise MethodError("rrf has not been trained: it needs the folder that `train` filled")
        with reading("the trained networks", site.weights):
            weights, facts = artifacts.kept(site.weights)
            partition = Partition(**weights["partition"])
            self.networks = CellNetworks(partition.cells, PLACE + REST + FACING * self._facing)
            self.networks.load_state_dict(weights["cells"])
            self.measure = Measure.of_facts(facts)
        self.networks.eval().requires_grad_(False).to(torch_device())
        self.partition = partition.to(torch_device())
        self._frames = LitFrames(site.scene, SURFACE)

    def render(self, view: View, stages: Stages) -> Prediction:
        """Direct light, then the networks of the parts that are seen."""
        area = area_light(view, "rrf")
        frame = self._frames.read(view, area, self.settings, stages)
        with stages.stage("inference"), torch.inference_mode():
            place, rest = described(frame.images, view.camera, area, self.measure, self._facing)
            seen = (frame.images["normal"] != 0).any(dim=0).flatten().nonzero()[:, 0]
            light = torch.zeros_like(place).flatten(1)
            for some in seen.split(AT_ONCE):
                points, others = (part.flatten(1)[:, some].T for part in (place, rest))
                light[:, some] = predicted(self.networks, self.partition, points, others).T
            unit = unit_of(area).to(light.device) * self.measure.indirect
            return frame.with_indirect(light.reshape(place.shape) * unit)
