"""Time of a training, and the interval of its looks at the held-out error."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from gibench.baselines.training.errors import TrainingError

LOOKS = 50
"""Looks at the held-out error, unless the budget says how many steps apart they are."""

LOOKING = 0.2
"""Share of the seconds that looks may take, where the budget does not say how many steps apart they are."""

PLANNED_FROM, PLANNED_UNTIL = 0.02, 0.98
"""Shares of the training between which the number of steps is planned, where it is not given."""

WARM = 2
"""Steps that are no measure of the others: the first ones allocate and compile."""


@dataclass(frozen=True)
class Plan:
    """From step `at` on: `steps` in all, looks at the held-out error `look_every` of them apart."""

    at: int
    steps: int
    look_every: int


@dataclass(frozen=True)
class Budget:
    """The end of a training, whichever comes first.

    steps: how many are made; learning rates fall to their end over them. seconds: of the clock, looks and waiting for
    data included; when they are over the training ends with the best weights so far. Where only seconds are given,
    the number of steps is planned from the speed of the last ones, again and again. look_every: steps between two looks
    at the held-out error. patience: steps without a better error that end the training. plans: those of a training by
    the clock, `Trained.plans`, in the place of its seconds; with its `steps` they give its weights again.
    """

    steps: int | None = None
    seconds: float | None = None
    look_every: int | None = None
    patience: int | None = None
    plans: tuple[Plan, ...] | None = None

    def __post_init__(self) -> None:
        """Raises TrainingError for a budget without an end, and for numbers that count nothing."""
        if self.steps is None and self.seconds is None:
            raise TrainingError("a training needs an end: give its budget steps, seconds or both")
        for name in ("steps", "look_every", "patience"):
            value = getattr(self, name)
            if value is not None and (isinstance(value, bool) or int(value) != value or value < 1):
                raise TrainingError(f"budget: {name} must be a whole number above 0, not {value!r}")
        if self.seconds is not None and not (math.isfinite(self.seconds) and self.seconds > 0):
            raise TrainingError(f"budget: seconds must be above 0, not {self.seconds!r}")
        if self.plans is not None:
            if self.steps is None or self.look_every is not None:
                raise TrainingError(
                    "budget: plans need the steps that were made, and hold the steps between looks"
                )
            if any(plan.steps <= plan.at for plan in self.plans) or any(
                first.at >= then.at for first, then in pairwise(self.plans)
            ):
                raise TrainingError(
                    f"budget: plans must follow each other and end after they begin: {self.plans}"
                )

    def looks(self, a_look: float) -> int:
        """How many there are, where no number of steps is between them. a_look: seconds of one."""
        if self.seconds is None or self.seconds * LOOKING >= LOOKS * a_look:
            return LOOKS
        return max(1, int(self.seconds * LOOKING / a_look))

    def plan(self, made: int, looked: int, spent: float, a_step: float, a_look: float) -> Plan:
        """Steps that the seconds allow. made: already, in `spent` seconds with as many looks. a_step, a_look: seconds
        of one.
        """
        assert self.seconds is not None
        if self.look_every is not None:  # each step then has its share of a look
            left, looks = self.seconds - spent, 0
            a_step += a_look / self.look_every
        else:
            looks = max(1, self.looks(a_look) - looked)
            left = self.seconds - spent - looks * a_look
        steps = max(1, int(left / max(a_step, 1e-9)))
        return Plan(made, made + steps, self.look_every or math.ceil(steps / looks))


def next_plan(share: float) -> float:
    """Share of the training at which its steps are planned again, after it was at that share: twice as much in its
    first part, half of what is left in its second, so that an error of a plan costs little; infinite near the end.
    """
    after = min(2 * share, (1 + share) / 2)
    return after if after <= PLANNED_UNTIL else math.inf
