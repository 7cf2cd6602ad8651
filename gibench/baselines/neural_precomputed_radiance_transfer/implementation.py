"""The method `nprt`: indirect light by a network that is told a code of the environment."""

from __future__ import annotations

from typing import ClassVar

from torch import Tensor

from gibench.baselines.method import Method
from gibench.baselines.neural_precomputed_radiance_transfer import METHOD
from gibench.baselines.neural_precomputed_radiance_transfer.environment import picture_of
from gibench.baselines.neural_precomputed_radiance_transfer.network import TransferNetwork
from gibench.baselines.neural_precomputed_radiance_transfer.training import (
    STEPS,
    RadianceTransfer,
    in_units,
)
from gibench.baselines.relighting.examples import Examples, Light
from gibench.baselines.relighting.implementation import RelitByNetwork
from gibench.baselines.training.reproducible import seeded
from gibench.rendering.backend import torch_device
from gibench.rendering.lighting import EnvironmentMap


class NeuralTransfer(RelitByNetwork):
    """See `gibench.baselines.neural_precomputed_radiance_transfer.METHOD`."""

    method: ClassVar[Method] = METHOD
    steps: ClassVar[int] = STEPS
    network: TransferNetwork

    def untrained(self, seed: int) -> TransferNetwork:
        """As the settings say."""
        with seeded(seed):
            return TransferNetwork(separated=bool(self.settings["separated"]))

    def learner(self, examples: Examples, apart: Examples, seed: int) -> RadianceTransfer:
        """As the settings say."""
        network = self.untrained(seed).to(torch_device())
        return RadianceTransfer(network, examples, apart, int(self.settings["batch"]), seed)

    def light_of(self, environment: EnvironmentMap) -> Light:
        """Its picture (3, 128, 256)."""
        return picture_of(environment)

    def told(self, light: Light) -> tuple[Tensor, Tensor]:
        """The code of the light, and its mean radiances."""
        picture, mean = in_units(light)
        return self.network.encoder(picture[None].to(torch_device()))[0], mean.to(torch_device())

    def radiance(self, points: Tensor, material: Tensor, told: tuple[Tensor, Tensor]) -> Tensor:
        """What both branches say."""
        return self.network.frame(points, material, *told)
