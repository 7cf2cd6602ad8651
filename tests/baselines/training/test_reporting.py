"""What a training says while it runs: a bar, lines, a log for TensorBoard."""

from __future__ import annotations

import io
import sys

import pytest
from rich.console import Console

from gibench.baselines.training import progress
from gibench.baselines.training.budget import Budget
from gibench.baselines.training.errors import TrainingError
from gibench.baselines.training.loop import train
from gibench.baselines.training.progress import Standing
from tests.baselines.training.toys import Fit, points


def console(monkeypatch, terminal):
    out = io.StringIO()
    monkeypatch.setattr(
        progress, "Console", lambda *, stderr: Console(file=out, force_terminal=terminal, width=80)
    )
    return out


def test_a_file_gets_a_line_at_the_end_and_one_now_and_then(monkeypatch):
    out = console(monkeypatch, False)
    train(Fit(), points(), Budget(steps=5), seed=0, title="fit")
    (line,) = out.getvalue().splitlines()
    assert line.startswith("fit: step 5/5, loss ")
    assert ", held out " in line
    monkeypatch.setattr(progress, "QUIET_SECONDS", 0.0)
    out = console(monkeypatch, False)
    train(Fit(), points(), Budget(steps=5), seed=0, title="fit")
    assert len(out.getvalue().splitlines()) == 6
    assert out.getvalue().splitlines()[3].endswith(" left")


@pytest.mark.parametrize("budget", [Budget(steps=30), Budget(steps=30, seconds=99), Budget(seconds=0.3)])
def test_a_terminal_gets_a_bar_that_fits(monkeypatch, budget):
    out = console(monkeypatch, True)
    train(Fit(), points(), budget, seed=0, title="neural-global-illumination")
    told = out.getvalue()
    assert "neural-global-illumination" in told
    assert "held out" in told
    lines = told.replace("\x1b", "\n").splitlines()
    assert max(map(len, lines)) <= 90  # a line of 80, and what sets its colour


def test_the_time_left_is_the_smaller_of_two():
    assert Standing(1, 10, 0.1, 3725.2, 1.0, 1.0).left_text == "1:02:05"
    assert Standing(1, None, 0.1, None, 1.0, 1.0).left_text == "-:--:--"
    assert Standing(1, None, 0.1, None, 1.0, 1.0).steps_text == "1/?"


def test_a_log_for_tensorboard_says_what_was_seen(tmp_path):
    pytest.importorskip("tensorboard")
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    trained = train(Fit(), points(), Budget(steps=8, look_every=4), seed=0, log=tmp_path)
    read = EventAccumulator(str(tmp_path)).Reload()
    assert set(read.Tags()["scalars"]) == {"squared error", "held-out error", "seconds"}
    assert [event.step for event in read.Scalars("squared error")] == list(range(1, 9))
    assert [event.step for event in read.Scalars("held-out error")] == [4, 8]
    assert read.Scalars("held-out error")[1].value == pytest.approx(trained.curve[-1].error)


def test_a_log_without_tensorboard_is_named(tmp_path, monkeypatch):
    for name in [name for name in sys.modules if name.split(".")[0] == "tensorboard"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delitem(sys.modules, "torch.utils.tensorboard", raising=False)
    monkeypatch.setitem(sys.modules, "tensorboard", None)
    with pytest.raises(TrainingError, match="pip install tensorboard"):
        train(Fit(), points(), Budget(steps=1), seed=0, log=tmp_path)
