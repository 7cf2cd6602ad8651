"""What the methods share that add to a frame's direct light the indirect light that a network makes of it."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import nn

from gibench.baselines.direct_light.tracer import DirectLight
from gibench.baselines.image_to_image.camera_space import in_camera_space
from gibench.baselines.image_to_image.device_frames import DeviceFrames, channels_first
from gibench.baselines.image_to_image.examples import READ, Examples
from gibench.baselines.image_to_image.frames import Frames, held_out, share_of
from gibench.baselines.image_to_image.learner import EPOCHS, IndirectLight, TrainingPlan
from gibench.baselines.image_to_image.shading import CHANNELS, geometry, indirect
from gibench.baselines.image_to_image.units import Units
from gibench.baselines.method import MethodError, Prediction, Setting, Site, Training, View, reading
from gibench.baselines.sources import digest
from gibench.baselines.stages import Stages
from gibench.baselines.training import artifacts
from gibench.baselines.training.budget import Budget
from gibench.baselines.training.checkpoints import Checkpoint
from gibench.baselines.training.loop import train
from gibench.baselines.training.reproducible import seeded
from gibench.rendering.backend import torch_device

HELD_OUT, MOST_HELD_OUT = 0.05, 24
"""Share of the training rooms that a network does not learn from, and how many of their frames are looked at."""


class IndirectByNetwork(DirectLight):
    """A method with `KNOBS`. A subclass says what network it is, a module as `shading.indirect` takes it."""

    mixed = True
    """Whether steps of the network are faster in `precision.mixed`."""

    def __init__(self, settings: Mapping[str, Setting]) -> None:
        """settings: all knobs of the method."""
        super().__init__(settings)
        self.settings = dict(settings)

    def network(self) -> nn.Module:
        """The network, untrained."""
        raise NotImplementedError

    @staticmethod
    def parts_of(site: Site) -> list[str]:
        """Direct light as it is shown, as networks are given it, and what is scored beside."""
        return ["full", "direct_diffuse", *(["specular"] if "specular" in site.parts else [])]

    def train(self, training: Training) -> float:
        """Learn indirect light from the rooms that are not held out."""
        views = training.views
        learned, apart = held_out(views, HELD_OUT, MOST_HELD_OUT)
        learned = share_of(views, learned, float(self.settings["images"]))
        plan = TrainingPlan.of(self.settings, training.seed)
        with seeded(plan.seed):
            network = self.network().to(torch_device())
        frames = [Frames(views, READ, numbers) for numbers in (learned, apart)]
        units = Units.of_frames(frames[0])
        examples = [Examples(some, units) for some in frames]
        learner = IndirectLight(network, examples[0], examples[1], plan, mixed=self.mixed)
        steps = None if training.seconds else EPOCHS * -(-len(learned) // plan.batch)
        owner = {**self.settings, "views": views.sha256, "sources": digest(type(self).__module__)}
        trained = train(
            learner,
            learner.batches(),
            Budget(steps=steps, seconds=training.seconds),
            seed=plan.seed,
            checkpoint=Checkpoint(training.checkpoint, owner),
            title=type(self).__name__,
        )
        facts = {} if units.in_view is None else {"in_view": units.in_view}
        artifacts.keep(training.folder, trained, **facts)
        return trained.before

    def prepare(self, site: Site) -> None:
        """Read the network, and record what a frame needs."""
        super().prepare(site)
        if site.weights is None:
            raise MethodError("the network has not been trained: it needs the folder that `train` filled")
        network = self.network()
        with reading("the trained network", site.weights):
            weights, facts = artifacts.kept(site.weights)
            network.load_state_dict(weights["network"])
            self._units = Units(float(facts["in_view"]) if "in_view" in facts else None)
        self.parameters = sum(one.numel() for one in network.parameters())
        self._network = network.eval().requires_grad_(False).to(torch_device())
        self._surfaces = DeviceFrames(
            site.scene, [name for name in CHANNELS if name not in ("direct_diffuse", "albedo")]
        )

    def render(self, view: View, stages: Stages) -> Prediction:
        """Direct light, and what the network says to it. `lit`: share of the pixels that direct light falls on."""
        parts = self.images(view, stages, ("full", "direct_diffuse"))
        with stages.stage("g-buffer"):
            surfaces = in_camera_space(self._surfaces.read(view.camera, view.resolution), view.camera)
        with stages.stage("inference"), torch.inference_mode():
            full, direct, albedo = (
                channels_first(parts[name]) for name in ("full", "direct_diffuse", "albedo")
            )
            unit = self._units.of(direct, albedo, view.shot.lighting.area)
            made = indirect(self._network, direct[None], albedo[None], geometry(surfaces)[None], unit[None])[
                0
            ]
            # Albedo is 0 in the sky, and what is remodulated with it is not.
            made = torch.where((surfaces["normal"] != 0).any(dim=0), made, 0)
            images = [image.movedim(0, -1).contiguous() for image in (full + made, made)]

        def diffuse() -> torch.Tensor:
            return (direct + made).movedim(0, -1)

        lit = float((direct > 0).any(dim=0).float().mean())
        extra = {"parameters": float(self.parameters), "lit": lit}
        return Prediction(images[0], parts.get("specular"), extra, diffuse=diffuse, indirect=images[1])
