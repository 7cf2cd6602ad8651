"""How the network learns a room (Gao et al. 2022, section 3.5): by differences of codes, then by LPIPS of crops too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from gibench.baselines.image_to_image.frames import Frames
from gibench.baselines.method import Setting
from gibench.baselines.moving_light.kept import KeptExamples, some_of, widened
from gibench.baselines.moving_light.measure import CODE, Measure, area_of, per_flux, unit_of
from gibench.baselines.neural_global_illumination.inputs import assembled
from gibench.baselines.neural_global_illumination.network import FULL, SMALL, NeuralGlobalIllumination, Size
from gibench.baselines.training.batches import batches
from gibench.baselines.training.budget import Budget
from gibench.baselines.training.checkpoints import Checkpoint
from gibench.baselines.training.crops import random_window
from gibench.baselines.training.curves import Trained
from gibench.baselines.training.display import displayed
from gibench.baselines.training.learner import Learner, Step
from gibench.baselines.training.loop import train
from gibench.baselines.training.losses.perceptual import SMALLEST, Lpips
from gibench.baselines.training.losses.pixels import absolute
from gibench.baselines.training.precision import mixed
from gibench.baselines.training.reproducible import seeded
from gibench.baselines.training.schedule import half_cosine, set_rate

STEPS = 1_000_000
"""Where no time is set (section 3.7.1)."""

RATES = {"full": 1e-4, "small": 1e-3}
"""Of Adam at the start, by network; it falls along half a cosine. The paper has 1e-4, and makes a hundred times the
steps of a CPU."""

CROPS = {"full": 256, "small": 64}
"""Pixels along a side of what a step learns from, by network, where no knob says. The U-Net of the full one has eight
levels, and smaller images are padded to 256."""

BATCH = 2
"""Crops a step; the paper has one image of 256 × 256."""

LARGEST_GRADIENT = 1.0
"""Norm that gradients are cut down to."""

PERCEPTUAL = 1.0
"""Weight of LPIPS, λ (section 3.5)."""

PERCEPTUAL_FROM, PERCEPTUAL_EVERY, PERCEPTUAL_SIDE = 0.8, 4, 64
"""Share of the training after which LPIPS is looked at, steps from one look to the next, each with as much more weight,
and pixels along a side: VGG16 costs more than the small network, and the paper's order is not said."""


class Example(NamedTuple):
    """A frame. inputs: (34, H, W). code: of indirect radiance, rest: all other light as it is shown, (3, H, W).

    shown: (3, 1, 1), what a decoded unit of indirect radiance is as it is shown.
    """

    inputs: Tensor
    code: Tensor
    rest: Tensor
    shown: Tensor


class Examples(KeptExamples[Example]):
    """Frames of a room as examples, by number."""

    def __init__(self, frames: Frames, measure: Measure, lighting: str) -> None:
        """lighting: one of `inputs.LIGHTING`."""
        self.frames, self.measure, self.lighting = frames, measure, lighting
        super().__init__(len(frames))

    def made(self, index: int) -> Example:
        """Read one."""
        images, area = self.frames[index], area_of(self.frames, index)
        indirect = images["indirect_diffuse"] + images["indirect_specular"]
        inputs = assembled(images, self.frames.camera(index), area, self.measure, self.lighting)
        code = CODE.encode(per_flux(indirect, area) / self.measure.indirect)
        exposure = self.frames.exposure(index)
        rest = ((images["color"] - indirect).clamp(min=0) * exposure).clamp(max=1)
        shown = unit_of(area) * (self.measure.indirect * exposure)
        return Example(inputs, code, rest, shown)


@dataclass(frozen=True)
class TrainingPlan:
    """What decides a training, beside its frames. size: of the network. seconds: None for STEPS."""

    network: str
    size: Size
    lpips: bool
    crop: int
    seed: int
    seconds: float | None

    @staticmethod
    def of(settings: Mapping[str, Setting], seed: int, seconds: float | None) -> TrainingPlan:
        """From the settings of the method."""
        name = str(settings["network"])
        crop = int(settings["crop"]) or CROPS[name]
        return TrainingPlan(name, size_of(settings), bool(settings["lpips"]), crop, seed, seconds)


def size_of(settings: Mapping[str, Setting]) -> Size:
    """Of the network."""
    size = {"full": FULL, "small": SMALL}[str(settings["network"])]
    if not settings["cnn"]:
        size = replace(size, levels=())
    return size if settings["encoding"] else replace(size, frequencies=0)


class Predicting(Learner):
    """The network of a room."""

    def __init__(
        self, examples: Examples, judged: Sequence[Example], plan: TrainingPlan, device: str = "cpu"
    ) -> None:
        """judged: the held-out frames. Raises WeightsError where LPIPS has none."""
        self.examples, self.plan = examples, plan
        with seeded(plan.seed):
            self.network = NeuralGlobalIllumination(plan.size, len(judged[0].inputs))
        self.network.begin_at(
            torch.stack([one.code.mean(dim=(1, 2)) for one in some_of(examples)]).mean(dim=0)
        )
        self.network.to(device)
        self.held_out = [Example(*(part.to(device) for part in widened(one))) for one in judged]
        self.lpips = Lpips().to(device) if plan.lpips else None
        self.anew_at = self.CHOSEN_FROM if plan.lpips else 0.0
        optimiser = torch.optim.Adam(self.network.parameters(), lr=RATES[plan.network], fused=True)
        super().__init__({"network": self.network}, {"network": optimiser})

    def trained(self, checkpoint: Checkpoint | None) -> Trained:
        """Train until the budget is spent."""
        plan = self.plan
        crops = batches(self.examples, BATCH, plan.seed, draw=self._crop)
        budget = Budget(steps=None if plan.seconds else STEPS, seconds=plan.seconds)
        return train(self, crops, budget, seed=plan.seed, checkpoint=checkpoint, title="ngi")

    def _crop(self, example: Example, random: np.random.Generator) -> Example:
        window = random_window(example.code.shape[-2:], self.plan.crop, random)
        inputs, code, rest, shown = example
        return widened(Example(window.of(inputs), window.of(code), window.of(rest), shown))

    def error(self) -> Tensor:
        """The mean absolute difference of codes over the held-out frames."""
        errors = [absolute(self.network(one.inputs[None]), one.code[None]) for one in self.held_out]
        return torch.stack(errors).mean()

    def step(self, batch: Example, now: Step) -> dict[str, Tensor]:
        """Down equation 5."""
        set_rate(self.optimisers["network"], RATES[self.plan.network] * half_cosine(now.progress))
        inputs, code, rest, shown = (part.to(self.device) for part in batch)
        with mixed(self.device):
            output = self.network(inputs).float()
        losses = {"pixels": absolute(output, code)}
        loss = losses["pixels"]
        if self._looks(now, code):
            window = random_window(code.shape[-2:], PERCEPTUAL_SIDE, now.random)
            images = [displayed(window.of(CODE.decode(part) * shown + rest), 1.0) for part in (output, code)]
            assert self.lpips is not None
            with mixed(self.device):
                losses["lpips"] = self.lpips(*images).float()
            loss = loss + PERCEPTUAL_EVERY * PERCEPTUAL * losses["lpips"]
        self.descend("network", loss, largest_gradient=LARGEST_GRADIENT)
        return {name: value.detach() for name, value in losses.items()}

    def _looks(self, now: Step, code: Tensor) -> bool:
        """Whether this step has LPIPS in its loss."""
        due = now.progress >= PERCEPTUAL_FROM and now.number % PERCEPTUAL_EVERY == 0
        return self.lpips is not None and due and min(code.shape[-2:]) >= SMALLEST
