"""Learning rates over a training: factors in [0, 1] of its progress, which runs from 0 to 1."""

from __future__ import annotations

import math

from torch.optim import Optimizer


def half_cosine(progress: float) -> float:
    """From 1 to 0 along half a cosine (Loshchilov & Hutter 2017, without restarts)."""
    return 0.5 * (1 + math.cos(math.pi * progress))


def flat_then_linear(progress: float, *, flat: float = 0.5) -> float:
    """1 for the first share of the training, `flat` in [0, 1), then linearly to 0 (Isola et al. 2017: one half)."""
    return min(1.0, (1 - progress) / (1 - flat))


def set_rate(optimiser: Optimizer, rate: float) -> None:
    """Set the learning rate of all parameters of an optimiser."""
    for group in optimiser.param_groups:
        group["lr"] = rate
