"""Learners: networks, their optimisers, and a step."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.optim import Optimizer

Weights = dict[str, dict[str, Tensor]]
"""Tensors on the CPU by network and name."""


@dataclass(frozen=True)
class Step:
    """State of a training.

    number: steps made before this one. progress: in [0, 1), share of the training that they are, for schedules. random:
    for what this step draws; it depends on nothing but the training's seed and the number, as do torch's own draws.
    """

    number: int
    progress: float
    random: np.random.Generator


class Learner(ABC):
    """Networks, optimisers, and the two things that a method knows about them: a step, and a held-out error.

    All that a step depends on, beside its batch and `Step`, is in the networks and the optimisers; what else there is
    goes into `state` and `load_state`. Then a training that was cut off goes on to the same weights.
    """

    anew_at = 0.0
    """Progress after which weights are chosen, where another loss set in: those of before are given up for these, even
    where these have a larger held-out error, which may not know what the new loss is for.
    """

    CHOSEN_FROM = 0.95
    """Of a loss that sets in late: by then its steps have done their work, and the rate is next to nothing."""

    def __init__(
        self,
        networks: Mapping[str, nn.Module],
        optimisers: Mapping[str, Optimizer],
        *,
        product: Sequence[str] | None = None,
    ) -> None:
        """networks, optimisers: by name, on their device. product: networks that outlive the training, all of them
        unless they are named (a discriminator does not).
        """
        self.networks, self.optimisers = dict(networks), dict(optimisers)
        self.product = tuple(self.networks if product is None else product)

    @abstractmethod
    def step(self, batch: Any, now: Step) -> Mapping[str, Tensor]:
        """Make one step with each optimiser, and say the losses, detached scalars by name, the one to watch first."""

    @abstractmethod
    def error(self) -> float | Tensor:
        """The held-out error: ≥ 0, smaller is better. Called in evaluation mode, without gradients."""

    @property
    def device(self) -> torch.device:
        """Of the first parameter."""
        return next(parameter.device for net in self.networks.values() for parameter in net.parameters())

    def look(self) -> float:
        """The held-out error now."""
        for network in self.networks.values():
            network.eval()
        try:
            with torch.no_grad():
                return float(self.error())
        finally:
            for network in self.networks.values():
                network.train()

    def descend(self, name: str, loss: Tensor, *, largest_gradient: float | None = None) -> None:
        """One step of that optimiser down a loss.

        largest_gradient: norm that the gradients of its parameters are cut down to, so that one bright highlight does
        not undo much.
        """
        optimiser = self.optimisers[name]
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        if largest_gradient is not None:
            parameters = [p for group in optimiser.param_groups for p in group["params"]]
            nn.utils.clip_grad_norm_(parameters, largest_gradient)
        optimiser.step()

    def weights(self) -> Weights:
        """A copy of the tensors of the product, on the CPU."""
        return {name: _copied(self.networks[name]) for name in self.product}

    def state(self) -> dict[str, Any]:
        """All that the next steps depend on: tensors, numbers, text, lists and dicts of them."""
        return {
            "networks": {name: network.state_dict() for name, network in self.networks.items()},
            "optimisers": {name: optimiser.state_dict() for name, optimiser in self.optimisers.items()},
        }

    def load_state(self, state: Mapping[str, Any]) -> None:
        """Go back to a `state`. Raises KeyError, RuntimeError or ValueError for that of another learner."""
        for name, network in self.networks.items():
            network.load_state_dict(state["networks"][name])
        for name, optimiser in self.optimisers.items():
            optimiser.load_state_dict(state["optimisers"][name])


def _copied(network: nn.Module) -> dict[str, Tensor]:
    return {name: value.detach().cpu().clone() for name, value in network.state_dict().items()}
