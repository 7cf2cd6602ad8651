"""How the network learns the transport of a scene (Raghavan et al. 2023, section 5)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from torch import Tensor, nn

from gibench.baselines.method import Setting
from gibench.baselines.neural_free_viewpoint_relighting.draws import Draw, Important, spread
from gibench.baselines.neural_free_viewpoint_relighting.network import (
    FULL,
    SMALL,
    Size,
    TransportNetwork,
)
from gibench.baselines.relighting.examples import CODE, Example, Examples, Light, Seen
from gibench.baselines.relighting.learner import FRAMES, JUDGED_PIXELS, RelightingLearner
from gibench.baselines.training.reproducible import seeded

STEPS = 200_000
"""Where no time is set. The paper trains for 16 hours, without saying how many steps that are."""

JUDGED_WAVELETS = 64
"""Of a frame that is held out."""


@dataclass(frozen=True)
class TrainingPlan:
    """What decides a training, beside its frames and its end.

    size, faces, encoding: of the network. pixels, learned: of a step. important: whether pixels are drawn where it is
    hard.
    """

    size: Size
    faces: int
    encoding: bool
    pixels: int
    learned: int
    important: bool
    seed: int

    @staticmethod
    def of(settings: Mapping[str, Setting], seed: int) -> TrainingPlan:
        """From the settings of the method."""
        return TrainingPlan(
            {"full": FULL, "small": SMALL}[str(settings["network"])],
            int(settings["faces"]),
            bool(settings["encoding"]),
            int(settings["batch"]),
            int(settings["learned"]),
            settings["pixels"] == "important",
            seed,
        )

    def network(self, field: Callable[[Size], nn.Module]) -> TransportNetwork:
        """Untrained. field: makes that of the network's size."""
        with seeded(self.seed):
            return TransportNetwork(field(self.size), self.size, self.faces, encoding=self.encoding)


class WaveletTransport(RelightingLearner):
    """The network of a scene."""

    rate: ClassVar[float] = 2e-3

    epsilon: ClassVar[float] = 1e-15
    """Features begin at 1e-4, and so do gradients (Müller et al. 2022, section 4)."""

    momenta: ClassVar[tuple[float, float]] = (0.9, 0.99)
    """As theirs: an entry that is hit after a long silence must not move for long."""

    def __init__(
        self, network: TransportNetwork, examples: Examples, apart: Examples, plan: TrainingPlan
    ) -> None:
        """network: of the plan, on its device. apart: what is held out."""
        self.drawing = Draw(max(1, plan.pixels // FRAMES), plan.learned)
        super().__init__(network, Important(examples) if plan.important else examples, apart, plan.seed)

    def draw(self, example: tuple[Seen, Light], random: np.random.Generator) -> Example:
        """By the four strategies."""
        return self.drawing(example, random)

    def judged(self, example: tuple[Seen, Light]) -> Example:
        """With the wavelets of a frame."""
        return spread(example, JUDGED_PIXELS, JUDGED_WAVELETS)

    def loss(self, made: Tensor, true: Tensor) -> Tensor:
        """Equation 8."""
        return (CODE.encode(made) - CODE.encode(true)).square().mean()
