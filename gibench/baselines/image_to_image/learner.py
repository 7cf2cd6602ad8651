"""Training a network of indirect light: content, perception and a discriminator (Gai, Wang & Li, section 3.4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn

from gibench.baselines.image_to_image.examples import STOPS, Draw, Examples, inputs_of
from gibench.baselines.image_to_image.frames import Images
from gibench.baselines.image_to_image.shading import LIGHT, OUTPUT, Inputs, demodulated, in_units
from gibench.baselines.method import Setting
from gibench.baselines.training.batches import batches
from gibench.baselines.training.crops import random_window
from gibench.baselines.training.display import displayed
from gibench.baselines.training.errors import TrainingError
from gibench.baselines.training.learner import Learner, Step
from gibench.baselines.training.loop import Batches
from gibench.baselines.training.losses import adversarial, perceptual
from gibench.baselines.training.losses.adversarial import PatchGan, fooling, judging
from gibench.baselines.training.losses.perceptual import Vgg16Features
from gibench.baselines.training.losses.pixels import absolute, smooth_absolute
from gibench.baselines.training.precision import mixed
from gibench.baselines.training.reproducible import seeded
from gibench.baselines.training.schedule import half_cosine, set_rate

CONTENT, PERCEPTUAL, ADVERSARIAL = 0.7, 0.28, 0.02
"""Weights of the losses, ω (section 3.4)."""

BEND = 0.02
"""Difference of log(1 + light) below which smooth L1 bends. They are about 0.1: bent at 1, it would be half their
square, with a tenth of the gradient, and VGG16 would outweigh it.
"""

RATE, DISCRIMINATOR_RATE, DISCRIMINATOR_BETA = 1e-3, 2e-4, 0.5
"""Of Adam for the network, which falls along half a cosine to nothing, and of Adam for the discriminator, with
its β₁.
"""

LARGEST_GRADIENT = 1.0
"""Norm that gradients of the network are cut down to, of a step that weighs as much as one."""

LOOKED_FROM, LOOKED_EVERY, LOOKED_SIDE = 0.5, 4, 64
"""Share of the training after which there are the perceptual and the adversarial loss, steps from one with them to the
next, each with as much more weight, and pixels along a side of what they look at: a look takes as long as a step.
"""

EPOCHS = 80
"""Passes over the training frames where no seconds end a training (section 5.1)."""


@dataclass(frozen=True)
class TrainingPlan:
    """What decides a training, beside its frames and its network.

    crop: pixels along a side of what a step sees of a frame, batch: frames a step. perceptual, adversarial: whether
    there are these losses.
    """

    crop: int
    batch: int
    perceptual: bool
    adversarial: bool
    seed: int

    @staticmethod
    def of(settings: Mapping[str, Setting], seed: int) -> TrainingPlan:
        """From the settings of a method."""
        return TrainingPlan(
            int(settings["crop"]),
            int(settings["batch"]),
            bool(settings["perceptual"]),
            bool(settings["adversarial"]),
            seed,
        )


class IndirectLight(Learner):
    """A network of `shading.indirect`, and a discriminator of single colours that learns along."""

    def __init__(
        self,
        network: nn.Module,
        learned: Examples,
        held_out: Examples,
        plan: TrainingPlan,
        *,
        mixed: bool = False,
    ) -> None:
        """network: on its device. mixed: whether it learns in `precision.mixed`.

        Raises TrainingError for frames or crops that are too small for the losses of the plan.
        """
        self.learned, self.plan, self.mixed = learned, plan, mixed
        # Read once, and before any clock says what a look takes.
        examples = [inputs_of(held_out[index]) for index in range(len(held_out))]
        self.held_out = [{name: image[None] for name, image in example.items()} for example in examples]
        for example in examples:
            _check(example["direct"].shape[-2:], plan)
        self.network = network
        device = next(network.parameters()).device
        networks = {"network": network}
        optimisers = {"network": torch.optim.Adam(network.parameters(), lr=RATE, fused=True)}
        if plan.adversarial:
            with seeded(plan.seed):
                discriminator = PatchGan(LIGHT + 1).to(device)
            networks["judge"] = discriminator
            optimisers["judge"] = torch.optim.Adam(
                discriminator.parameters(),
                lr=DISCRIMINATOR_RATE,
                betas=(DISCRIMINATOR_BETA, 0.999),
                fused=True,
            )
        self.features = Vgg16Features().to(device) if plan.perceptual else None
        self.anew_at = self.CHOSEN_FROM if plan.perceptual or plan.adversarial else 0.0
        super().__init__(networks, optimisers, product=["network"])

    def batches(self, processes: int = 0) -> Batches:
        """Of what `step` learns from."""
        plan = self.plan
        draw = Draw(plan.crop, STOPS if self.learned.units.own else 0.0)
        return batches(self.learned, plan.batch, plan.seed, draw=draw, processes=processes)

    def error(self) -> Tensor:
        """Mean absolute difference of display values of diffuse light, direct and indirect, of whole frames."""
        errors = []
        for example in self.held_out:
            batch = _on(example, self.device)
            inputs = Inputs.of(batch["direct"], batch["albedo"], batch["geometry"], batch["unit"])
            made = inputs.radiance(self.network(inputs.light, inputs.geometry))
            errors.append(absolute(*_shown(batch, made)))
        return torch.stack(errors).mean()

    def step(self, batch: Any, now: Step) -> dict[str, Tensor]:
        """A step of both optimisers down equation 6."""
        batch = _on(batch, self.device)
        set_rate(self.optimisers["network"], RATE * half_cosine(now.progress))
        inputs = Inputs.of(batch["direct"], batch["albedo"], batch["geometry"], batch["unit"])
        with mixed(self.device, pays=self.mixed):
            code = self.network(inputs.light, inputs.geometry)
        light = OUTPUT.decode(code.float())
        # Where its unit is 0, no light being in view or none of a colour, nothing is learned: what comes out is black.
        lit = inputs.unit > 0
        light = torch.where(lit, light, light.detach())
        truth = in_units(demodulated(batch["truth"], inputs.albedo), inputs.unit)
        truth = torch.where(lit, truth, light.detach())
        made, true = torch.log1p(light), torch.log1p(truth)
        content = smooth_absolute(made, true, bend=BEND)
        losses = {"content": content}
        loss = CONTENT * content
        any_look = self.features is not None or "judge" in self.networks
        looked = any_look and now.progress >= LOOKED_FROM and now.number % LOOKED_EVERY == 0
        window = random_window(made.shape[-2:], LOOKED_SIDE, now.random) if looked else None
        if self.features is not None and window is not None:
            shown = _shown(batch, inputs.radiance_of(light))
            with mixed(self.device):
                looked_at = self.features(*(window.of(image) for image in shown))
            losses["perceptual"] = looked_at.float()
            loss = loss + LOOKED_EVERY * PERCEPTUAL * losses["perceptual"]
        discriminator = self.networks.get("judge")
        if discriminator is not None and window is not None:
            # A colour at a time, whatever the network does.
            given = window.of(inputs.light).transpose(1, 2).flatten(0, 1)
            ours, theirs = (window.of(image).flatten(0, 1)[:, None] for image in (made, true))
            # What the discriminator learns comes from its own loss, below.
            discriminator.requires_grad_(False)
            losses["adversarial"] = fooling(discriminator(given, ours))
            discriminator.requires_grad_(True)
            loss = loss + LOOKED_EVERY * ADVERSARIAL * losses["adversarial"]
        # Cut down to the norm of other steps, a step with more weight would lose that weight again.
        weight = 1 if window is None else LOOKED_EVERY
        self.descend("network", loss, largest_gradient=weight * LARGEST_GRADIENT)
        if discriminator is not None and window is not None:
            losses["judge"] = judging(discriminator(given, theirs), discriminator(given, ours.detach()))
            self.descend("judge", losses["judge"])
        return {"loss": loss, **losses}


def _check(size: Sequence[int], plan: TrainingPlan) -> None:
    """size: height and width of frames. The late losses would refuse them when most of the training is over."""
    side = min(*size, plan.crop, LOOKED_SIDE)
    for loss, wanted, smallest in (
        ("perceptual", plan.perceptual, perceptual.SMALLEST),
        ("adversarial", plan.adversarial, adversarial.SMALLEST),
    ):
        if wanted and side < smallest:
            raise TrainingError(
                f"the {loss} loss looks at {smallest} pixels along each side at least, and training frames of "
                f"{size[1]} × {size[0]} in crops of {plan.crop} have {side}: ask for more, or switch `{loss}` off"
            )


def _on(batch: Images, device: torch.device) -> Images:
    return {name: image.to(device) for name, image in batch.items()}


def _shown(batch: Images, indirect: Tensor) -> tuple[Tensor, Tensor]:
    """Diffuse light with that indirect light and with the true one, as it is displayed."""
    direct, exposure = batch["direct"], batch["exposure"]
    return displayed(direct + indirect, exposure), displayed(direct + batch["truth"], exposure)
