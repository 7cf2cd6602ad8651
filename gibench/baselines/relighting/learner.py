"""Learners of networks that say the indirect light of a surface: a step, and what is held out."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from gibench.baselines.relighting.examples import CODE, Example, Examples, Light, Seen
from gibench.baselines.training.batches import Examples as Drawn
from gibench.baselines.training.batches import batches
from gibench.baselines.training.learner import Learner, Step
from gibench.baselines.training.loop import Batches
from gibench.baselines.training.losses.pixels import absolute
from gibench.baselines.training.precision import mixed
from gibench.baselines.training.schedule import half_cosine, set_rate

FRAMES = 4
"""Of a step, each under its own light; together they have its pixels."""

LARGEST_GRADIENT = 1.0
"""Norm that gradients are cut down to."""

JUDGED_PIXELS = 170
"""Of a frame that is held out."""


class RelightingLearner(Learner):
    """A network of the inputs of an `Example`, which says radiance (…, N, 3). A subclass says what a step draws of a
    frame, and what its loss is.
    """

    rate: ClassVar[float]
    """Of Adam at the start; it falls along half a cosine."""

    epsilon: ClassVar[float] = 1e-8
    """Of Adam."""

    momenta: ClassVar[tuple[float, float]] = (0.9, 0.999)
    """Of Adam, β₁ and β₂."""

    def __init__(self, network: nn.Module, examples: Drawn, apart: Examples, seed: int) -> None:
        """network: on its device. examples: what `draw` is given. apart: what is held out."""
        self.examples, self.network, self.seed = examples, network, seed
        optimiser = torch.optim.Adam(
            network.parameters(), lr=self.rate, betas=self.momenta, eps=self.epsilon, fused=True
        )
        super().__init__({"network": network}, {"network": optimiser})
        # Read once, and before any clock says what a look takes.
        found = [self.judged(apart[index]) for index in range(len(apart))]
        self.held_out: Sequence[Example] = [one.on(self.device) for one in found if one.truth.numel()]

    @abstractmethod
    def draw(self, example: tuple[Seen, Light], random: np.random.Generator) -> Example:
        """What a step learns from a frame."""

    @abstractmethod
    def judged(self, example: tuple[Seen, Light]) -> Example:
        """What of a frame that is held out is looked at: JUDGED_PIXELS at most."""

    def made(self, example: Example) -> Tensor:
        """What the network says of an example in a step, (F, N, 3)."""
        with mixed(self.device):
            found: Tensor = self.network(*example.inputs)
        return found.float()

    @abstractmethod
    def loss(self, made: Tensor, true: Tensor) -> Tensor:
        """Of exposed radiance, (F, N, 3) each."""

    def batches(self) -> Batches:
        """Of what `step` learns from."""
        return batches(self.examples, FRAMES, self.seed, draw=self.draw)

    def error(self) -> Tensor:
        """Mean absolute difference of codes of radiance."""
        errors = [
            absolute(CODE.encode(self.network(*one.inputs)), CODE.encode(one.truth)) for one in self.held_out
        ]
        return torch.stack(errors).mean() if errors else torch.zeros(())

    def step(self, batch: Any, now: Step) -> dict[str, Tensor]:
        """Down the loss."""
        set_rate(self.optimisers["network"], self.rate * half_cosine(now.progress))
        example = Example(*batch).on(self.device)
        loss = self.loss(self.made(example), example.truth)
        self.descend("network", loss, largest_gradient=LARGEST_GRADIENT)
        return {"loss": loss.detach()}
