"""How the network learns the transport of a scene (Raghavan et al. 2023, section 5)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from gibench.baselines.method import Setting
from gibench.baselines.neural_free_viewpoint_relighting.examples import (
    CODE,
    Disagreement,
    Draw,
    Example,
    Examples,
    spread,
)
from gibench.baselines.neural_free_viewpoint_relighting.network import (
    FULL,
    SMALL,
    HashField,
    Size,
    TransportNetwork,
)
from gibench.baselines.training.batches import batches
from gibench.baselines.training.budget import Budget
from gibench.baselines.training.checkpoints import Checkpoint
from gibench.baselines.training.curves import Trained
from gibench.baselines.training.learner import Learner, Step
from gibench.baselines.training.loop import train
from gibench.baselines.training.losses.pixels import absolute
from gibench.baselines.training.reproducible import seeded
from gibench.baselines.training.schedule import half_cosine, set_rate

STEPS = 200_000
"""Where no time is set. The paper trains for 16 hours, without saying how many steps that are."""

RATE = 5e-3
"""Of Adam at the start; it falls along half a cosine."""

EPSILON = 1e-15
"""Of Adam: features begin at 1e-4, and so do gradients (Müller et al. 2022, section 4)."""

FRAMES = 4
"""Of a step, each under its own light; together they have its pixels."""

LARGEST_GRADIENT = 1.0
"""Norm that gradients are cut down to."""

JUDGED_PIXELS, JUDGED_WAVELETS = 512, 64
"""Of a frame that is held out."""


@dataclass(frozen=True)
class TrainingPlan:
    """What decides a training, beside its frames.

    size, table, faces, encoding: of the network. pixels, learned: of a step. important: whether pixels are drawn where
    it is hard. seconds: None for STEPS.
    """

    size: Size
    table: int
    faces: int
    encoding: bool
    pixels: int
    learned: int
    important: bool
    seed: int
    seconds: float | None

    @staticmethod
    def of(settings: Mapping[str, Setting], seed: int, seconds: float | None) -> TrainingPlan:
        """From the settings of the method."""
        return TrainingPlan(
            {"full": FULL, "small": SMALL}[str(settings["network"])],
            int(settings["table"]),
            int(settings["faces"]),
            bool(settings["encoding"]),
            int(settings["batch"]),
            int(settings["learned"]),
            settings["pixels"] == "important",
            seed,
            seconds,
        )

    def network(self) -> TransportNetwork:
        """Untrained."""
        field = HashField(self.size, self.table)
        return TransportNetwork(field, self.size, self.faces, encoding=self.encoding)


class Relighting(Learner):
    """The network of a scene."""

    def __init__(self, examples: Examples, apart: Examples, plan: TrainingPlan, device: str = "cpu") -> None:
        """apart: what is held out."""
        self.examples, self.plan = examples, plan
        with seeded(plan.seed):
            self.network = plan.network().to(device)
        # Read once, and before any clock says what a look takes.
        self.held_out = [
            _on(spread(apart[index], JUDGED_PIXELS, JUDGED_WAVELETS), device) for index in range(len(apart))
        ]
        disagreement = None
        if plan.important:
            disagreement = Disagreement(examples.seen(index) for index in range(len(examples)))
        self.draw = Draw(max(1, plan.pixels // FRAMES), plan.learned, disagreement)
        optimiser = torch.optim.Adam(self.network.parameters(), lr=RATE, eps=EPSILON)
        super().__init__({"network": self.network}, {"network": optimiser})

    def trained(self, checkpoint: Checkpoint | None) -> Trained:
        """Train until the budget is spent."""
        plan = self.plan
        drawn = batches(self.examples, FRAMES, plan.seed, draw=self.draw)
        budget = Budget(steps=None if plan.seconds else STEPS, seconds=plan.seconds)
        return train(self, drawn, budget, seed=plan.seed, checkpoint=checkpoint, title="nfvr")

    def error(self) -> Tensor:
        """Of what is held out: mean absolute difference of codes, with the wavelets of a frame."""
        errors = [
            absolute(CODE.encode(self._radiance(one)), CODE.encode(one.truth)) for one in self._judged()
        ]
        return torch.stack(errors).mean() if errors else torch.zeros(())

    def step(self, batch: Example, now: Step) -> dict[str, Tensor]:
        """Down equation 8."""
        set_rate(self.optimisers["network"], RATE * half_cosine(now.progress))
        batch = _on(batch, self.device)
        loss = (CODE.encode(self._radiance(batch)) - CODE.encode(batch.truth)).square().mean()
        self.descend("network", loss, largest_gradient=LARGEST_GRADIENT)
        return {"loss": loss.detach()}

    def _radiance(self, one: Example) -> Tensor:
        radiance: Tensor = self.network(one.points, one.material, one.places, one.light)
        return radiance

    def _judged(self) -> Sequence[Example]:
        return [one for one in self.held_out if len(one.points)]


def _on(example: Example, device: torch.device | str) -> Example:
    return Example(*(part.to(device) for part in example))
