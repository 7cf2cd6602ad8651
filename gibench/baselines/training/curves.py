"""Record of a training: its curve of held-out error against steps and seconds, and how it ended."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Literal

from gibench.baselines.training.budget import Plan
from gibench.baselines.training.learner import Weights

Ended = Literal["steps", "seconds", "patience", "diverged"]
"""All steps were made; the seconds were over; no better error for too long; a loss was not finite."""


@dataclass(frozen=True)
class Look:
    """The held-out error at a step. seconds: of training until then, this look included. loss: mean since the look
    before it, of the loss to watch; 0 before the first step.
    """

    step: int
    seconds: float
    error: float
    loss: float


@dataclass(frozen=True)
class Trained:
    """The end of a training.

    weights: those with the smallest held-out error since `Learner.anew_at`, the earliest of equal ones, by network and
    name. best: the look at them; its step is 0 where the networks as they were built are the best. plans: how learning
    rates were laid out; the last one holds to the end. steps: those that were made. seconds: in all; of these, before:
    in runs cut off, waited: for data.
    """

    weights: Weights
    best: Look
    curve: tuple[Look, ...]
    steps: int
    plans: tuple[Plan, ...]
    seconds: float
    before: float
    waited: float
    ended: Ended

    def record(self) -> dict[str, Any]:
        """All but the weights, for JSON: an error that was not finite is None there."""

        def plain(look: Look) -> dict[str, Any]:
            return {name: v if math.isfinite(v) else None for name, v in asdict(look).items()}

        return {
            "ended": self.ended,
            "steps": self.steps,
            "plans": [asdict(plan) for plan in self.plans],
            "seconds": self.seconds,
            "waited_seconds": self.waited,
            "best": plain(self.best),
            "curve": [plain(look) for look in self.curve],
        }
