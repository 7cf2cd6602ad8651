"""The loop: steps, looks at the held-out error, checkpoints, and the end.

    learner = Mine(networks, examples)
    trained = train(learner, batches, Budget(seconds=2400), seed=seed, checkpoint=Checkpoint(path, owner))

A training is counted in steps and can be cut off between any two of them, or within one: what a step draws at random
depends on the seed and its number alone, and batches can begin at any step, so that it goes on from its last checkpoint
to the weights, bit for bit, of one that ran through.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, nullcontext
from dataclasses import asdict, astuple
from pathlib import Path
from typing import Any

from torch import Tensor

from gibench.baselines.training.budget import LOOKS, PLANNED_FROM, WARM, Budget, Plan, next_plan
from gibench.baselines.training.checkpoints import Checkpoint, machine
from gibench.baselines.training.curves import Ended, Look, Trained
from gibench.baselines.training.errors import CheckpointError, TrainingError
from gibench.baselines.training.events import Write, events
from gibench.baselines.training.files import UNREADABLE, unreadable
from gibench.baselines.training.learner import Learner, Step, Weights
from gibench.baselines.training.progress import Standing, Tell, telling
from gibench.baselines.training.reproducible import deterministic, random_of_step, seeded

Batches = Callable[[int], Iterable[Any]]
"""Batches without end from that step on: `batches(first)` yields for step first, first + 1 …"""

READ_EVERY = 10
"""Steps after which losses are read on a GPU, which has to be waited for; on a CPU it is every step."""


def train(
    learner: Learner,
    batches: Batches,
    budget: Budget,
    *,
    seed: int,
    checkpoint: Checkpoint | None = None,
    reproducible: bool = True,
    log: Path | None = None,
    title: str = "training",
) -> Trained:
    """Train until the budget is spent; the best weights, and how it went.

    checkpoint: where the state is kept, and found again; it stays after the end, so that nothing is lost before the
    weights are stored: `remove` it then. reproducible: whether torch may only use algorithms that repeat their bits.
    log: a folder for TensorBoard. Steps and looks run under torch's own random numbers of `seed`, which others do not
    notice.

    Raises TrainingError where a loss is not finite before the held-out error got better once, or batches end,
    CheckpointError for a checkpoint of another training or a damaged one, StorageError where it cannot be written.
    """
    run = _Run(learner, budget, seed, checkpoint)
    with ExitStack() as stack:
        stack.enter_context(deterministic() if reproducible else nullcontext())
        stack.enter_context(seeded(seed))
        run.begin()
        if run.ended is None:
            tell = stack.enter_context(telling(title))
            write = stack.enter_context(events(log, run.step))
            run.go_on(batches, tell, write)
    return run.result()


class _Run:
    """A training on the way: the numbers that a checkpoint keeps, beside those of the learner."""

    def __init__(self, learner: Learner, budget: Budget, seed: int, checkpoint: Checkpoint | None) -> None:
        self.learner, self.budget, self.seed, self.checkpoint = learner, budget, seed, checkpoint
        self.device = learner.device
        self.owner: dict[str, Any] = {"seed": seed, **machine(self.device)}
        self.owner |= {f"budget {name}": value for name, value in asdict(budget).items() if value is not None}
        self.step = 0
        self.plans: list[Plan] = []
        self.planned_at = 0.0  # progress at the last plan
        self.best_at = 0.0  # progress at the best look
        self.plan_again = PLANNED_FROM  # progress, by the clock or by steps, at which steps are planned next
        self.seconds = self.before = self.waited = 0.0
        self.curve: list[Look] = []
        self.best: Look
        self.weights: Weights
        self.ended: Ended | None = None
        self.sums = [0.0, 0]  # of the loss to watch since the last look, and how many
        self.unread: list[dict[str, Tensor]] = []
        self.a_look = 0.0
        self.made = 0  # steps of this run
        self.measured, self.measured_seconds = 0, 0.0  # steps since the last plan, and what they took
        if budget.steps is not None and budget.plans is None:
            every = budget.look_every or math.ceil(budget.steps / LOOKS)
            self.plans.append(Plan(0, budget.steps, every))

    def begin(self) -> None:
        """From a checkpoint, or with a look at the networks as they are."""
        self.started = time.perf_counter()
        state = self.checkpoint.read(self.owner, self.device) if self.checkpoint else None
        if state is not None:
            self._load(state)
            self.before = self.seconds
            self.started = time.perf_counter() - self.before
        else:
            self._look()
            if not math.isfinite(self.best.error):
                raise TrainingError(f"the held-out error before the first step is {self.best.error}")
        self.begun = self._now()

    def go_on(self, batches: Batches, tell: Tell, write: Write) -> None:
        """To the end."""
        source = iter(batches(self.step))
        try:
            while self.ended is None:
                self._make_step(source)
                self._plan()
                self._settle(write)
                tell(self._standing())
        finally:
            getattr(source, "close", lambda: None)()  # a generator that reads ahead has something to put away
        self._save()
        tell(self._standing(over=True))

    def _make_step(self, source: Iterator[Any]) -> None:
        asked = time.perf_counter()
        try:
            batch = next(source)
        except StopIteration:
            raise TrainingError(f"the batches end before step {self.step + 1}: they must go on") from None
        given = time.perf_counter()
        now = Step(self.step, self._progress(), random_of_step(self.seed, self.step))
        losses = self.learner.step(batch, now)
        self.unread.append({name: value.detach() for name, value in losses.items()})
        self.step += 1
        self.waited += given - asked
        self.made += 1
        if self.made > WARM:
            self.measured += 1
            self.measured_seconds += time.perf_counter() - asked

    @property
    def planned(self) -> int | None:
        """Steps of the whole training, as far as it is known."""
        return self.plans[-1].steps if self.plans else None

    def _progress(self) -> float:
        """Of the training, in [0, 1]. A new plan spreads what is left over the steps that are left: it never jumps."""
        if not self.plans:
            return 0.0
        plan = self.plans[-1]
        over = (self.step - plan.at) / (plan.steps - plan.at)
        return min(self.planned_at + (1 - self.planned_at) * over, 1.0)

    def _plan(self) -> None:
        """Plan the steps, where it is time to: other work on the machine comes and goes, and steps may grow longer
        towards the end.
        """
        plan = None
        if self.budget.plans is not None:
            plan = next((plan for plan in self.budget.plans if plan.at == self.step), None)
        elif self.budget.steps is None and self.measured:
            assert self.budget.seconds is not None
            spent = self._now()
            share = max(spent / self.budget.seconds, self._progress())
            if share >= self.plan_again:
                a_step = self.measured_seconds / self.measured
                plan = self.budget.plan(self.step, len(self.curve) - 1, spent, a_step, self.a_look)
                self.plan_again = next_plan(share)
                self.measured, self.measured_seconds = 0, 0.0
        if plan is not None:
            self.planned_at = self._progress()
            self.plans.append(plan)

    def _settle(self, write: Write) -> None:
        """Work after a step: losses are read, the held-out error is looked at, the state is kept, or all ends."""
        ending = self._spent()
        looking = self._look_is_due() or ending is not None
        saving = self.checkpoint is not None and self.checkpoint.due
        reading = looking or saving or self.device.type == "cpu" or self.step % READ_EVERY == 0
        if reading and not self._read(write):
            self.ended = "diverged"
            return
        if looking:
            self._look()
            write(self.step, {"held-out error": self.curve[-1].error, "seconds": self.curve[-1].seconds})
            ending = ending or self._spent()
            if ending is None and self.budget.patience is not None:
                ending = "patience" if self.step - self.best.step >= self.budget.patience else None
        self.ended = ending
        if saving and ending is None:
            self._save()

    def _spent(self) -> Ended | None:
        if self.step == (self.budget.steps or self.planned):
            return "steps"
        # The last look belongs to the training too.
        due = self.a_look if self.curve[-1].step != self.step else 0.0
        if self.budget.seconds is not None and self._now() + due >= self.budget.seconds:
            return "seconds"
        return None

    def _look_is_due(self) -> bool:
        every = self.plans[-1].look_every if self.plans else self.budget.look_every
        return every is not None and self.step - self.curve[-1].step >= every

    def _look(self) -> None:
        started = time.perf_counter()
        error = self.learner.look()
        ended = time.perf_counter()
        self.a_look = ended - started
        total, count = self.sums
        self.sums = [0.0, 0]
        look = Look(self.step, ended - self.started, error, total / count if count else 0.0)
        progress = self._progress()
        anew = self.best_at < self.learner.anew_at <= progress and math.isfinite(error)
        if not self.curve or error < self.best.error or anew:
            self.best, self.best_at, self.weights = look, progress, self.learner.weights()
        self.curve.append(look)

    def _read(self, write: Write) -> bool:
        """Take the losses of the last steps from the device; whether all of them are finite."""
        losses, self.unread = self.unread, []
        for number, named in enumerate(losses, self.step - len(losses) + 1):
            values = {name: float(value) for name, value in named.items()}
            write(number, values)
            if not all(map(math.isfinite, values.values())):
                return False
            self.sums[0] += next(iter(values.values()), 0.0)
            self.sums[1] += 1
        return True

    def _save(self) -> None:
        self.seconds = self._now()
        if self.checkpoint is not None:
            self.checkpoint.write(self._state(), self.owner)

    def result(self) -> Trained:
        """Result of `train`."""
        assert self.ended is not None
        if self.ended == "diverged" and self.best.step == 0:
            raise TrainingError(
                f"training diverged: a loss of step {self.step} is not finite, and no look before it found a better "
                "held-out error than that of the untrained networks"
            )
        return Trained(
            weights=self.weights,
            best=self.best,
            curve=tuple(self.curve),
            steps=self.step,
            plans=tuple(self.plans),
            seconds=self.seconds,
            before=self.before,
            waited=self.waited,
            ended=self.ended,
        )

    def _now(self) -> float:
        """Seconds of training until now."""
        return time.perf_counter() - self.started

    def _standing(self, over: bool = False) -> Standing:
        spent, budget = self._now(), self.budget
        share = 0.0
        left: list[float] = []
        if self.planned:
            share = self.step / self.planned
            if self.made > WARM:
                left.append((self.planned - self.step) * (spent - self.begun) / self.made)
        if budget.seconds:
            share = max(share, spent / budget.seconds)
            left.append(budget.seconds - spent)
        loss = self.sums[0] / self.sums[1] if self.sums[1] else self.curve[-1].loss
        until = max(0.0, min(left)) if left else None
        return Standing(self.step, self.planned, min(share, 1.0), until, loss, self.best.error, over)

    def _state(self) -> dict[str, Any]:
        return {
            "learner": self.learner.state(),
            "weights": self.weights,
            "best": astuple(self.best),
            "curve": [astuple(look) for look in self.curve],
            "plans": [astuple(plan) for plan in self.plans],
            "sums": self.sums,
            **{name: getattr(self, name) for name in _NUMBERS},
        }

    def _load(self, state: dict[str, Any]) -> None:
        assert self.checkpoint is not None
        try:
            self.learner.load_state(state["learner"])
            self.weights = {
                network: {name: tensor.cpu() for name, tensor in tensors.items()}
                for network, tensors in state["weights"].items()
            }
            self.best = Look(*state["best"])
            self.curve = [Look(*look) for look in state["curve"]]
            self.plans = [Plan(*plan) for plan in state["plans"]]
            self.sums = list(state["sums"])
            for name in _NUMBERS:
                setattr(self, name, state[name])
        except UNREADABLE as problem:
            raise CheckpointError(unreadable(self.checkpoint.path, problem)) from problem


_NUMBERS = ("step", "planned_at", "plan_again", "best_at", "seconds", "waited", "ended", "a_look")
"""Attributes of a run that a checkpoint keeps."""
