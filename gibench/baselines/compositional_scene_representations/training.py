"""How the networks learn a room: from crops of its training frames and the observations of their light."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from gibench.baselines.compositional_scene_representations.network import FULL, SMALL, Represented, Size
from gibench.baselines.image_to_image.frames import Frames, Images
from gibench.baselines.method import Setting
from gibench.baselines.moving_light.kept import KeptExamples, some_of, widened
from gibench.baselines.moving_light.measure import Measure, area_of, per_flux, unit_vectors
from gibench.baselines.training.batches import batches
from gibench.baselines.training.budget import Budget
from gibench.baselines.training.checkpoints import Checkpoint
from gibench.baselines.training.crops import random_window
from gibench.baselines.training.curves import Trained
from gibench.baselines.training.learner import Learner, Step
from gibench.baselines.training.loop import train
from gibench.baselines.training.losses.pixels import absolute
from gibench.baselines.training.losses.structural import dissimilarity
from gibench.baselines.training.precision import mixed
from gibench.baselines.training.reproducible import seeded
from gibench.baselines.training.schedule import half_cosine, set_rate
from gibench.rendering.camera import PinholeCamera

STEPS = 1_000_000
"""Where no time is set."""

SIZES = {"full": FULL, "small": SMALL}
RATES = {"full": 1e-4, "small": 1e-3}
"""Of Adam at the start, by network; it falls along half a cosine. The authors have 1e-4."""

BATCH = 2
"""Crops a step; the authors have sixteen images."""

ABSOLUTE = 2.0
"""Weight of the absolute difference, beside 1 − SSIM."""

LARGEST_GRADIENT = 1.0
"""Norm that gradients are cut down to."""


class Example(NamedTuple):
    """A frame. light: of its observations, (OBSERVATIONS, 3, SIDE, SIDE). pixels: (PIXEL, H, W). truth: (3, H, W)."""

    light: Tensor
    pixels: Tensor
    truth: Tensor


def described(images: Images, camera: PinholeCamera, measure: Measure) -> Tensor:
    """Channels of pixels, (PIXEL, H, W), finite."""
    place = images["position"]
    eye = place.new_tensor(camera.position)[:, None, None]
    parts = [measure.inside(place), images["normal"], unit_vectors(eye - place)]
    parts += [images[name] for name in ("albedo", "specular_albedo", "roughness")]
    return torch.where((images["normal"] != 0).any(dim=0, keepdim=True), torch.cat(parts), 0)


class Examples(KeptExamples[Example]):
    """Frames of a room as examples, by number."""

    def __init__(self, frames: Frames, light: Tensor, measure: Measure) -> None:
        """light: of the observations of each frame."""
        super().__init__(len(frames))
        self.frames, self.light, self.measure = frames, light, measure

    def made(self, index: int) -> Example:
        """Read one."""
        images, area = self.frames[index], area_of(self.frames, index)
        pixels = described(images, self.frames.camera(index), self.measure)
        indirect = images["indirect_diffuse"] + images["indirect_specular"]
        truth = torch.log1p(per_flux(indirect, area) / self.measure.indirect)
        return Example(self.light[index].float(), pixels, truth)


@dataclass(frozen=True)
class TrainingPlan:
    """What decides a training, beside its frames. seconds: None for STEPS."""

    network: str
    crop: int
    seed: int
    seconds: float | None

    @staticmethod
    def of(settings: Mapping[str, Setting], seed: int, seconds: float | None) -> TrainingPlan:
        """From the settings of the method."""
        return TrainingPlan(str(settings["network"]), int(settings["crop"]), seed, seconds)

    @property
    def size(self) -> Size:
        """Of the networks."""
        return SIZES[self.network]


class Representing(Learner):
    """The networks of a room."""

    def __init__(
        self,
        examples: KeptExamples[Example],
        judged: Sequence[Example],
        fixed: Tensor,
        poses: Tensor,
        plan: TrainingPlan,
        device: str = "cpu",
    ) -> None:
        """judged: what is held out. fixed, poses: see `network.Represented`."""
        self.examples, self.plan = examples, plan
        with seeded(plan.seed):
            self.network = Represented(plan.size, fixed.cpu(), poses.cpu())
        self.network.generator.begin_at(
            torch.stack([one.truth.mean(dim=(1, 2)) for one in some_of(examples)]).mean(dim=0)
        )
        self.network.to(device)
        self.held_out = [Example(*(part.to(device) for part in widened(one))) for one in judged]
        optimiser = torch.optim.Adam(self.network.parameters(), lr=RATES[plan.network], fused=True)
        super().__init__({"network": self.network}, {"network": optimiser})

    def trained(self, checkpoint: Checkpoint | None) -> Trained:
        """Train until the budget is spent."""
        plan = self.plan
        crops = batches(self.examples, BATCH, plan.seed, draw=self._crop)
        budget = Budget(steps=None if plan.seconds else STEPS, seconds=plan.seconds)
        return train(self, crops, budget, seed=plan.seed, checkpoint=checkpoint, title="cnnr")

    def _crop(self, example: Example, random: np.random.Generator) -> Example:
        window = random_window(example.truth.shape[-2:], self.plan.crop, random)
        return widened(Example(example.light, window.of(example.pixels), window.of(example.truth)))

    def error(self) -> Tensor:
        """Of what is held out: mean absolute difference of log1p."""
        errors = [
            absolute(self.network(one.light[None], one.pixels[None]), one.truth[None])
            for one in self.held_out
        ]
        return torch.stack(errors).mean()

    def step(self, batch: Example, now: Step) -> dict[str, Tensor]:
        """Down twice the absolute difference and 1 − SSIM."""
        set_rate(self.optimisers["network"], RATES[self.plan.network] * half_cosine(now.progress))
        light, pixels, truth = (part.to(self.device) for part in batch)
        with mixed(self.device):
            output = self.network(light, pixels).float()
        losses = {"pixels": absolute(output, truth), "structure": dissimilarity(output, truth)}
        loss = ABSOLUTE * losses["pixels"] + losses["structure"]
        self.descend("network", loss, largest_gradient=LARGEST_GRADIENT)
        return {name: value.detach() for name, value in losses.items()}
