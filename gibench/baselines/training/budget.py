"""Time of a training, and the interval of its looks at the held-out error."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gibench.baselines.training.errors import TrainingError

LOOKS = 50
"""Looks at the held-out error, unless the budget says how many steps apart they are."""

LOOKING = 0.2
"""Share of the seconds that looks may take, where the budget does not say how many steps apart they are."""

PLANNED_AFTER = 0.02
"""Share of the seconds after which the number of steps is planned, where it is not given."""

WARM = 2
"""Steps that are no measure of the others: the first ones allocate and compile."""


@dataclass(frozen=True)
class Budget:
    """The end of a training, whichever comes first.

    steps: how many are made; learning rates fall to their end over them. seconds: of the clock, looks and waiting for
    data included; when they are over the training ends with the best weights so far. Where only seconds are given,
    the number of steps is planned from the speed of the first ones, and is part of the result: equal numbers of steps
    give equal weights. look_every: steps between two looks at the held-out error. patience: steps without a better
    error that end the training.
    """

    steps: int | None = None
    seconds: float | None = None
    look_every: int | None = None
    patience: int | None = None

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

    def looks(self, a_look: float) -> int:
        """How many there are, where no number of steps is between them. a_look: seconds of one."""
        if self.seconds is None or self.seconds * LOOKING >= LOOKS * a_look:
            return LOOKS
        return max(1, int(self.seconds * LOOKING / a_look))

    def planned(self, made: int, spent: float, a_step: float, a_look: float) -> int:
        """Steps that the seconds allow. made: already, in `spent` seconds. a_step, a_look: seconds of one."""
        assert self.seconds is not None
        looks = self.looks(a_look) * a_look
        if self.look_every is not None:  # each step then has its share of a look
            looks, a_step = 0.0, a_step + a_look / self.look_every
        return made + max(1, int((self.seconds - spent - looks) / max(a_step, 1e-9)))
