"""How the networks learn a scene (Rainer et al. 2022): absolute differences of log(1 + x)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import torch
from torch import Tensor

from gibench.baselines.neural_precomputed_radiance_transfer.environment import mean_radiance
from gibench.baselines.neural_precomputed_radiance_transfer.network import TransferNetwork
from gibench.baselines.relighting.examples import Example, Examples, Light, Seen, evenly, some_of
from gibench.baselines.relighting.learner import FRAMES, JUDGED_PIXELS, RelightingLearner
from gibench.baselines.training.codes import MuLaw
from gibench.baselines.training.losses.pixels import absolute
from gibench.baselines.training.precision import mixed

STEPS = 500_000
"""Where no time is set."""

LOGARITHM = MuLaw(mu=1.0)
"""log(1 + x) / log 2, continued to negative numbers."""


class RadianceTransfer(RelightingLearner):
    """The networks of a scene."""

    rate: ClassVar[float] = 4e-4
    """The authors have 1e-4, and make many more steps."""

    network: TransferNetwork

    def __init__(
        self, network: TransferNetwork, examples: Examples, apart: Examples, pixels: int, seed: int
    ) -> None:
        """network: on its device. apart: what is held out. pixels: of a step."""
        self.pixels = max(1, pixels // FRAMES)
        super().__init__(network, examples, apart, seed)

    def draw(self, example: tuple[Seen, Light], random: np.random.Generator) -> Example:
        """Any pixels. A frame that sees no surface gives pixels that are black in truth, without light."""
        seen, picture = example
        if not len(seen.points):
            seen = Seen(*(torch.zeros(1, *part.shape[1:]) for part in seen))
            picture = np.zeros_like(picture)
        return example_of(
            seen, picture, torch.from_numpy(random.integers(len(seen.points), size=self.pixels))
        )

    def judged(self, example: tuple[Seen, Light]) -> Example:
        """Pixels all over the frame."""
        seen, picture = example
        found = example_of(seen, picture, evenly(seen, JUDGED_PIXELS))
        return Example(found.truth[None], tuple(part[None] for part in found.inputs))

    def made(self, example: Example) -> Tensor:
        """The code of the light is worth less than single precision; places in sines are not."""
        points, material, picture, mean = example.inputs
        with mixed(self.device):
            light = self.network.encoder(picture)
        return self.network.lit(points, material, light.float(), mean)

    def loss(self, made: Tensor, true: Tensor) -> Tensor:
        """Mean absolute difference of logarithms."""
        return absolute(LOGARITHM.encode(made), LOGARITHM.encode(true))


def example_of(seen: Seen, picture: Light, pixel: Tensor) -> Example:
    """Some pixels of a frame; inputs are points, material, the picture in units of its means, and these."""
    truth, points, material = some_of(seen, pixel)
    unit, mean = in_units(picture)
    return Example(truth, (points, material, unit, mean))


def in_units(picture: Light) -> tuple[Tensor, Tensor]:
    """A picture (3, H, 2·H), each colour in units of its own mean radiance, and these (3,); black stays black.

    Light transport keeps the three colours apart: twice the red is twice the red reflected, whatever there is of green
    and blue. With one unit for all an encoder would have to learn that, and of a few hundred environments, most of them
    warm, it learns one cast for all.
    """
    mean = mean_radiance(picture)
    unit = picture / np.where(mean > 0, mean, 1.0)[:, None, None]
    return torch.from_numpy(unit.astype(np.float32)), torch.from_numpy(mean.astype(np.float32))
