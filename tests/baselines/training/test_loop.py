"""The loop: that it learns, repeats itself, survives being killed at any step, and ends when it should."""

from __future__ import annotations

import itertools
import json
import math
import os
import signal
import subprocess
import sys
import time

import pytest
import torch

from gibench.baselines.training import loop
from gibench.baselines.training.budget import Budget, Plan
from gibench.baselines.training.checkpoints import Checkpoint
from gibench.baselines.training.errors import TrainingError
from gibench.baselines.training.loop import train
from tests.baselines.training.toys import Duel, Fit, everything, flat, points

STEPS = 12
BUDGET = Budget(steps=STEPS, look_every=5)


class Killed(BaseException):
    """As a signal would be: nothing but the test catches it."""


def dies_at(learner, number):
    real = learner.step

    def step(batch, now):
        if now.number == number:
            # The networks are changed before: a step that is cut off half-way leaves such things behind.
            with torch.no_grad():
                for network in learner.networks.values():
                    for parameter in network.parameters():
                        parameter.add_(1)
            raise Killed
        return real(batch, now)

    learner.step = step
    return learner


class Clock:
    """Of the loop, in the place of that of the machine: it stands still but for what a learner takes."""

    def __init__(self):
        self.now = 0.0

    def perf_counter(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds


@pytest.fixture
def clock(monkeypatch):
    made = Clock()
    monkeypatch.setattr(loop, "time", made)
    return made


def slow(learner, seconds, look=0.0, clock=time):
    """The learner, with steps and looks that take that long."""
    step, error = learner.step, learner.error

    def slower(batch, now):
        clock.sleep(seconds)
        return step(batch, now)

    def looks():
        clock.sleep(look)
        return error()

    learner.step, learner.error = slower, looks
    return learner


def test_it_learns_and_keeps_the_best_weights():
    learner = Fit()
    before = learner.look()
    trained = train(learner, points(), Budget(steps=400), seed=0)
    assert trained.ended == "steps"
    assert trained.steps == 400
    assert trained.plans == (Plan(0, 400, 8),)
    assert trained.best.error < 0.4 * before
    assert trained.best.error == min(look.error for look in trained.curve)
    learner.networks["fit"].load_state_dict(trained.weights["fit"])
    assert learner.look() == trained.best.error
    assert learner.networks["fit"].training


def test_the_curve_begins_untrained_ends_with_the_last_step_and_is_json():
    trained = train(Fit(), points(), BUDGET, seed=0)
    assert [look.step for look in trained.curve] == [0, 5, 10, 12]
    seconds = [look.seconds for look in trained.curve]
    assert seconds == sorted(seconds)
    assert seconds[-1] <= trained.seconds
    assert 0 <= trained.waited <= trained.seconds
    assert trained.curve[0].loss == 0
    assert all(look.loss > 0 for look in trained.curve[1:])
    record = json.loads(json.dumps(trained.record(), allow_nan=False))
    assert record["curve"][2] == {
        "step": 10,
        **{k: record["curve"][2][k] for k in ("seconds", "error", "loss")},
    }
    assert record["best"]["error"] == trained.best.error


def test_equal_seeds_give_equal_weights_and_others_others():
    first, second, other = (train(Fit(), points(), BUDGET, seed=seed).weights for seed in (3, 3, 4))
    assert torch.equal(flat(first), flat(second))
    assert not torch.equal(flat(first), flat(other))


def test_random_numbers_and_modes_of_others_are_left_alone():
    torch.manual_seed(11)
    expected = torch.rand(1)
    torch.manual_seed(11)
    train(Fit(), points(), BUDGET, seed=0)
    assert torch.rand(1) == expected
    assert not torch.are_deterministic_algorithms_enabled()


@pytest.mark.parametrize("kind", [Fit, Duel])
@pytest.mark.parametrize("processes", [0, pytest.param(1, id="loaded beside")])
def test_cut_off_at_any_step_it_ends_with_the_same_bits(tmp_path, kind, processes):
    whole = kind()
    expected = train(whole, points(), BUDGET, seed=2)
    numbers = range(STEPS) if not processes else (7,)
    for number in numbers:
        checkpoint = Checkpoint(tmp_path / f"{number}", {"method": "toy"}, every=0)
        with pytest.raises(Killed):
            train(dies_at(kind(), number), points(processes=processes), BUDGET, seed=2, checkpoint=checkpoint)
        assert checkpoint.path.exists() == (number > 0)
        learner = kind()
        made = []
        real = learner.step
        learner.step = lambda batch, now, real=real, made=made: (made.append(now.number), real(batch, now))[1]
        trained = train(learner, points(), BUDGET, seed=2, checkpoint=checkpoint)
        assert made == list(range(number, STEPS))
        assert everything(learner) == everything(whole)
        assert torch.equal(flat(trained.weights), flat(expected.weights))
        assert [(a.step, a.error, a.loss) for a in trained.curve] == [
            (b.step, b.error, b.loss) for b in expected.curve
        ]


def test_a_process_that_is_killed_goes_on(tmp_path):
    """SIGKILL, wherever it happens to be, several times."""
    code = (
        "import sys, pathlib; from tests.baselines.training.test_loop import *; "
        "checkpoint = Checkpoint(pathlib.Path(sys.argv[1]), {'method': 'toy'}, every=0); "
        "trained = train(slow(Fit(), .01), points(), Budget(steps=90), seed=2, checkpoint=checkpoint); "
        "torch.save(trained.weights, sys.argv[1] + '.weights')"
    )
    place = tmp_path / "checkpoint"
    for seconds in (0.3, 0.5):
        process = subprocess.Popen([sys.executable, "-c", code, str(place)])
        end = time.monotonic() + 60
        while not place.exists():
            assert process.poll() is None
            assert time.monotonic() < end
            time.sleep(0.01)
        time.sleep(seconds)
        os.kill(process.pid, signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL
    subprocess.run([sys.executable, "-c", code, str(place)], check=True, timeout=120)
    expected = train(Fit(), points(), Budget(steps=90), seed=2)
    assert torch.equal(flat(torch.load(f"{place}.weights")), flat(expected.weights))
    assert {path.name for path in tmp_path.iterdir()} <= {
        "checkpoint",
        "checkpoint.weights",
        *(path.name for path in tmp_path.glob(".checkpoint.partial-*")),
    }


def test_a_training_that_is_over_is_given_again_without_a_step(tmp_path):
    checkpoint = Checkpoint(tmp_path / "c", {"method": "toy"})
    first = train(Fit(), points(), BUDGET, seed=2, checkpoint=checkpoint)
    again = train(dies_at(Fit(), 0), points(), BUDGET, seed=2, checkpoint=checkpoint)
    assert again.record() == first.record()
    assert torch.equal(flat(again.weights), flat(first.weights))
    checkpoint.remove()
    checkpoint.remove()
    assert not checkpoint.path.exists()


def test_seconds_end_it_with_the_best_so_far(clock):
    learner = slow(Fit(), 0.01, 0.05, clock)
    trained = train(learner, points(), Budget(steps=10**6, seconds=1.0, look_every=20), seed=0)
    assert trained.ended == "seconds"
    # 20 steps and a look take .25; of the last quarter, .05 are kept for the look that comes at the end.
    assert trained.steps == 75
    assert [look.step for look in trained.curve] == [0, 20, 40, 60, 75]
    assert trained.best.error == min(look.error for look in trained.curve)
    assert trained.seconds == pytest.approx(1.0)


def test_seconds_that_were_spent_before_count(tmp_path, clock):
    checkpoint = Checkpoint(tmp_path / "c", {"method": "toy"}, every=0)
    budget = Budget(steps=10**6, seconds=1.0, look_every=20)
    with pytest.raises(Killed):
        train(dies_at(slow(Fit(), 0.02, 0, clock), 20), points(), budget, seed=0, checkpoint=checkpoint)
    clock.now += 1e6
    trained = train(slow(Fit(), 0.02, 0, clock), points(), budget, seed=0, checkpoint=checkpoint)
    assert trained.before == pytest.approx(0.4)
    assert trained.steps in (50, 51)  # as rounding has it
    assert trained.seconds == pytest.approx(1.0, abs=0.03)


def test_a_budget_too_small_for_a_step_gives_the_untrained_network(clock):
    trained = train(slow(Fit(), 5.0, 1.0, clock), points(), Budget(seconds=0.5), seed=0)
    assert (trained.ended, trained.steps) == ("seconds", 1)
    assert trained.best.step in (0, 1)


class Notes(Fit):
    """Keeps the progress of each step."""

    def __init__(self):
        super().__init__()
        self.seen = []

    def step(self, batch, now):
        self.seen.append(now.progress)
        return super().step(batch, now)


def test_where_only_seconds_are_given_the_steps_are_planned(clock):
    learner = slow(Notes(), 0.01, 0.01, clock)
    trained = train(learner, points(), Budget(seconds=3.0), seed=0)
    # .06 s, 2 %, are over after six steps; 50 looks are paid for first.
    assert trained.plans[0].at <= 7
    for plan in trained.plans:
        assert plan.steps == pytest.approx((3.0 - 50 * 0.01) / 0.01, abs=3)
    assert trained.ended == "steps"
    assert trained.seconds == pytest.approx(3.0, abs=0.05)
    assert len(trained.curve) == pytest.approx(1 + 50, abs=2)
    assert learner.seen == pytest.approx([n / trained.steps for n in range(trained.steps)], abs=0.03)


@pytest.mark.parametrize("changed", [0.2, 0.4, 4.0])
@pytest.mark.parametrize("at", [20, 150, 0.85])
def test_a_training_takes_its_seconds_whatever_becomes_of_the_speed(clock, at, changed):
    """Other work ends or begins at a step, or steps are others from some progress on: learning rates follow."""
    learner = slow(Notes(), 0.01, 0.01, clock)
    step = learner.step

    def other(batch, now):
        over = now.progress >= at if at < 1 else now.number >= at
        clock.sleep(0.01 * (changed - 1) if over else 0)
        return step(batch, now)

    learner.step = other
    trained = train(learner, points(), Budget(seconds=3.0), seed=0)
    assert trained.seconds == pytest.approx(3.0, rel=0.04)
    assert learner.seen == sorted(learner.seen)
    # A step is a three hundredth of the training; where steps take four times as long the last few share what is left.
    assert max(after - before for before, after in itertools.pairwise(learner.seen)) < (
        0.1 if changed > 1 else 0.02
    )
    assert learner.seen[-1] > 0.95
    assert len(trained.curve) <= 1 + 50 + 2


def test_a_training_by_the_clock_can_be_repeated(tmp_path, clock):
    def learner():
        made = slow(Fit(), 0.01, 0.02, clock)
        step = made.step
        made.step = lambda batch, now: (clock.sleep(0.02 if 30 < now.number < 60 else 0), step(batch, now))[1]
        return made

    trained = train(learner(), points(), Budget(seconds=3.0), seed=0)
    assert len(trained.plans) > 5
    budget = Budget(steps=trained.steps, plans=trained.plans)
    again = train(Fit(), points(), budget, seed=0)
    assert torch.equal(flat(again.weights), flat(trained.weights))
    assert [look.step for look in again.curve] == [look.step for look in trained.curve]
    assert again.plans == trained.plans

    checkpoint = Checkpoint(tmp_path / "c", {"method": "toy"}, every=0)
    with pytest.raises(Killed):
        train(dies_at(Fit(), 50), points(), budget, seed=0, checkpoint=checkpoint)
    after = train(Fit(), points(), budget, seed=0, checkpoint=checkpoint)
    assert torch.equal(flat(after.weights), flat(trained.weights))


@pytest.mark.parametrize(
    "budget",
    [
        {"seconds": 3.0, "plans": (Plan(0, 3, 1),)},
        {"steps": 3, "look_every": 1, "plans": (Plan(0, 3, 1),)},
        {"steps": 3, "plans": (Plan(2, 2, 1),)},
        {"steps": 3, "plans": (Plan(1, 3, 1), Plan(1, 4, 1))},
    ],
)
def test_plans_that_are_none_are_refused(budget):
    with pytest.raises(TrainingError, match="budget: plans"):
        Budget(**budget)


def test_looks_that_take_long_are_few(clock):
    """A fifth of the seconds is theirs at most, and the steps have the rest."""
    trained = train(slow(Fit(), 0.01, 0.2, clock), points(), Budget(seconds=5.0), seed=0)
    assert trained.plans[-1].steps == pytest.approx((5.0 - 5 * 0.2 - 0.2) / 0.01, abs=12)
    assert len(trained.curve) <= 1 + 5 + 1
    assert trained.seconds == pytest.approx(5.0, abs=0.25)


def test_weights_of_before_another_loss_are_given_up():
    """The held-out error falls to 2, but is 7, 6 and 8 once the other loss has set in."""
    errors = iter([9.0, 8, 7, 6, 5, 4, 3, 2, 7, 6, 8])
    learner = Fit()
    learner.anew_at, learner.error = 0.8, lambda: next(errors)
    trained = train(learner, points(), Budget(steps=10, look_every=1), seed=0)
    assert (trained.best.step, trained.best.error) == (9, 6)


def test_weights_without_a_held_out_error_take_the_place_of_none():
    errors = iter([9.0, 8, 7, 6, 5, 4, 3, 2, math.nan, math.nan, math.nan])
    learner = Fit()
    learner.anew_at, learner.error = 0.8, lambda: next(errors)
    trained = train(learner, points(), Budget(steps=10, look_every=1), seed=0)
    assert (trained.best.step, trained.best.error) == (7, 2)


def test_patience_ends_it():
    learner = Fit(rate=0.0)
    trained = train(learner, points(), Budget(steps=1000, look_every=5, patience=20), seed=0)
    assert (trained.ended, trained.steps, trained.best.step) == ("patience", 20, 0)


def test_a_loss_that_is_not_finite_ends_it_with_the_best_so_far():
    class Breaks(Fit):
        def step(self, batch, now):
            losses = super().step(batch, now)
            return losses if now.number < 300 else {"squared error": losses["squared error"] * math.nan}

    trained = train(Breaks(), points(), Budget(steps=1000, look_every=50), seed=0)
    assert (trained.ended, trained.steps) == ("diverged", 301)
    assert 0 < trained.best.step <= 300
    with pytest.raises(TrainingError, match=r"diverged: a loss of step 301 is not finite"):
        train(Breaks(rate=0.0), points(), Budget(steps=1000, look_every=50), seed=0)


def test_an_error_that_is_not_finite_before_the_first_step_is_named():
    class Blind(Fit):
        def error(self):
            return math.nan

    with pytest.raises(TrainingError, match="before the first step is nan"):
        train(Blind(), points(), BUDGET, seed=0)


def test_batches_that_end_are_named():
    def three(first):
        return itertools.islice(points()(first), 3)

    with pytest.raises(TrainingError, match="end before step 4"):
        train(Fit(), three, BUDGET, seed=0)


def test_batches_are_put_away_when_it_ends_and_when_it_fails():
    closed = []

    def kept(first):
        try:
            yield from points()(first)
        finally:
            closed.append(first)

    train(Fit(), kept, BUDGET, seed=0)
    with pytest.raises(Killed):
        train(dies_at(Fit(), 3), kept, BUDGET, seed=0)
    assert closed == [0, 0]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "needs an end"),
        ({"steps": 0}, "steps must be a whole number above 0, not 0"),
        ({"steps": 1.5}, "steps"),
        ({"steps": 5, "patience": -1}, "patience"),
        ({"seconds": 0.0}, "seconds must be above 0"),
        ({"seconds": math.nan}, "seconds"),
        ({"seconds": math.inf}, "seconds"),
    ],
)
def test_budgets_that_mean_nothing_are_named(given, said):
    with pytest.raises(TrainingError, match=said):
        Budget(**given)


def test_an_operation_that_cannot_repeat_its_bits_is_refused_only_when_it_is_asked_for(monkeypatch):
    """On a CPU: what torch is told is what matters."""
    seen = []

    class Notes(Fit):
        def step(self, batch, now):
            seen.append(torch.are_deterministic_algorithms_enabled())
            return super().step(batch, now)

    for reproducible in (True, False):
        train(Notes(), points(), Budget(steps=1), seed=0, reproducible=reproducible)
    assert seen == [True, False]


def test_only_the_product_is_kept():
    trained = train(Duel(), points(), BUDGET, seed=0)
    assert set(trained.weights) == {"generator"}


def test_on_a_gpu_losses_are_read_less_often(monkeypatch):
    """What a GPU does, with the device's name alone changed: fewer reads, the same weights."""
    expected = train(Fit(), points(), BUDGET, seed=0)
    reads = []
    real = loop._Run._read
    monkeypatch.setattr(loop._Run, "_read", lambda run, write: (reads.append(run.step), real(run, write))[1])
    monkeypatch.setattr(loop._Run, "device", torch.device("meta"), raising=False)
    monkeypatch.setattr(
        loop._Run,
        "__setattr__",
        lambda run, name, value: name != "device" and object.__setattr__(run, name, value),
    )
    trained = train(Fit(), points(), BUDGET, seed=0)
    assert reads == [5, 10, 12]
    assert torch.equal(flat(trained.weights), flat(expected.weights))
    assert [look.loss for look in trained.curve] == [look.loss for look in expected.curve]


def test_a_larger_gradient_than_allowed_is_cut_down():
    learner = Fit()
    network = learner.networks["fit"]
    before = [p.detach().clone() for p in network.parameters()]
    learner.optimisers["fit"] = torch.optim.SGD(network.parameters(), 1.0)
    learner.descend("fit", 1e9 * network(torch.ones(1, 1)).sum(), largest_gradient=0.5)
    moved = math.sqrt(
        sum(float((a.detach() - b).square().sum()) for a, b in zip(network.parameters(), before, strict=True))
    )
    assert moved == pytest.approx(0.5, rel=1e-4)
