"""The method `nfvr`: indirect light by a network, wavelet by wavelet."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, cast

import numpy as np
import torch
from torch import Tensor, nn

from gibench.baselines.method import Method, Setting, View
from gibench.baselines.neural_free_viewpoint_relighting import METHOD
from gibench.baselines.neural_free_viewpoint_relighting.network import HashField, Size, TransportNetwork
from gibench.baselines.neural_free_viewpoint_relighting.training import STEPS, TrainingPlan, WaveletTransport
from gibench.baselines.relighting.examples import Examples, Light
from gibench.baselines.relighting.implementation import RelitByNetwork
from gibench.baselines.wavelets.light import chosen_light, coefficients_of
from gibench.baselines.wavelets.selection import Weighting, energy_kept, replaced
from gibench.rendering.backend import torch_device
from gibench.rendering.lighting import EnvironmentMap


class NeuralRelighting(RelitByNetwork):
    """See `gibench.baselines.neural_free_viewpoint_relighting.METHOD`."""

    method: ClassVar[Method] = METHOD
    steps: ClassVar[int] = STEPS
    network: TransportNetwork

    def adjust(self, settings: Mapping[str, Setting]) -> None:
        """Take other settings that do not train."""
        super().adjust(settings)
        self._wavelets = int(settings["wavelets"])
        self._before = np.zeros(0, dtype=np.int64)
        self._selection = cast("Weighting", settings["selection"])
        self._precision = {"single": torch.float32, "bfloat16": torch.bfloat16}[str(settings["precision"])]

    def field(self, size: Size) -> nn.Module:
        """Where features of places come from."""
        return HashField(size, int(self.settings["table"]))

    def untrained(self, seed: int) -> TransportNetwork:
        """As the settings say."""
        return TrainingPlan.of(self.settings, seed).network(self.field)

    def learner(self, examples: Examples, apart: Examples, seed: int) -> WaveletTransport:
        """As the settings say."""
        network = self.untrained(seed).to(torch_device())
        return WaveletTransport(network, examples, apart, TrainingPlan.of(self.settings, seed))

    def light_of(self, environment: EnvironmentMap) -> Light:
        """Its Haar coefficients (6, S, S, 3)."""
        return coefficients_of(environment, int(self.settings["faces"]))

    def told(self, light: Light) -> tuple[Tensor, Tensor]:
        """Places and weights of the wavelets that matter most."""
        places, weights = chosen_light(light, self._wavelets, self._selection)
        return torch.from_numpy(places).to(torch_device()), torch.from_numpy(weights).to(torch_device())

    def numbers(self, view: View, light: Light, told: tuple[Tensor, Tensor]) -> dict[str, float]:
        """`energy`: share of the environment's that the chosen wavelets hold. `replaced`: share of them that the frame
        before had not, where there is one.
        """
        places = told[0].cpu().numpy()
        found = {"energy": energy_kept(light, places)}
        if view.previous is not None:
            found["replaced"] = replaced(places, self._before)
        self._before = places
        return found

    def radiance(self, points: Tensor, material: Tensor, told: tuple[Tensor, Tensor]) -> Tensor:
        """The dot product of light and transport."""
        return self.network.frame(points, material, *told, precision=self._precision)
