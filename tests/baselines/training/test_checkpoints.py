"""Checkpoints: whose they are, that they are whole or not there, and a disk that fills."""

from __future__ import annotations

import errno
import pickle
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from gibench.baselines.training import checkpoints
from gibench.baselines.training.budget import Budget
from gibench.baselines.training.checkpoints import Checkpoint
from gibench.baselines.training.errors import CheckpointError, StorageError, TrainingError
from gibench.baselines.training.files import read_tensors, write_tensors
from gibench.baselines.training.loop import train
from gibench.errors import GibenchError
from tests.baselines.training.toys import Duel, Fit, flat, points

BUDGET = Budget(steps=6, look_every=3)
OWNER = {"method": "toy", "version": 1}


@pytest.fixture
def done(tmp_path):
    checkpoint = Checkpoint(tmp_path / "checkpoint", OWNER)
    train(Fit(), points(), BUDGET, seed=0, checkpoint=checkpoint)
    return checkpoint.path


@pytest.mark.parametrize(
    ("owner", "budget", "seed", "said"),
    [
        ({**OWNER, "method": "other"}, BUDGET, 0, r"method: 'toy' there, 'other' here"),
        ({**OWNER, "version": 2}, BUDGET, 0, r"version: 1 there, 2 here"),
        ({**OWNER, "data": "abc"}, BUDGET, 0, r"data: None there, 'abc' here"),
        (OWNER, BUDGET, 1, r"seed: 0 there, 1 here"),
        (OWNER, Budget(steps=7, look_every=3), 0, r"budget steps: 6 there, 7 here"),
        (OWNER, Budget(steps=6, look_every=3, seconds=9), 0, r"budget seconds: None there, 9 here"),
    ],
)
def test_that_of_another_training_is_refused_by_name(done, owner, budget, seed, said):
    before = done.read_bytes()
    with pytest.raises(CheckpointError, match=said) as problem:
        train(Fit(), points(), budget, seed=seed, checkpoint=Checkpoint(done, owner))
    assert str(done) in str(problem.value)
    assert "\n" not in str(problem.value)
    assert done.read_bytes() == before


@pytest.mark.parametrize("what", ["torch", "threads", "instructions", "processor", "gpu"])
def test_that_of_another_machine_is_refused_by_name(done, monkeypatch, what):
    real = checkpoints.machine(torch.device("cpu"))
    monkeypatch.setattr(
        "gibench.baselines.training.loop.machine", lambda device: {**real, f"machine {what}": "another"}
    )
    with pytest.raises(CheckpointError, match=f"machine {what}: .* there, 'another' here"):
        train(Fit(), points(), BUDGET, seed=0, checkpoint=Checkpoint(done, OWNER))


def test_that_of_other_networks_is_named(done):
    with pytest.raises(CheckpointError, match=r"cannot be read .*remove it"):
        train(Duel(), points(), BUDGET, seed=0, checkpoint=Checkpoint(done, OWNER))


@pytest.mark.parametrize("content", [b"", b"no weights", "cut", "flipped", "list", "other", "code"])
def test_a_damaged_one_is_named_and_runs_no_code(done, content, tmp_path):
    whole = done.read_bytes()
    if content == "cut":
        content = whole[: len(whole) // 2]
    elif content == "flipped":
        content = whole[:100] + bytes(b ^ 255 for b in whole[100:200]) + whole[200:]
    elif content == "list":
        torch.save([1, 2], done)
        content = done.read_bytes()
    elif content == "other":
        torch.save({"state": 1}, done)
        content = done.read_bytes()
    elif content == "code":

        class Evil:
            def __reduce__(self):
                return Path.touch, (tmp_path / "ran",)

        content = pickle.dumps(Evil(), protocol=2)
    done.write_bytes(content)
    with pytest.raises(CheckpointError, match="remove it") as problem:
        train(Fit(), points(), BUDGET, seed=0, checkpoint=Checkpoint(done, OWNER))
    assert isinstance(problem.value, GibenchError)
    assert "\n" not in str(problem.value)
    assert not (tmp_path / "ran").exists()


FULL = """
import pathlib, resource, sys, torch
from tests.baselines.training.test_checkpoints import *
path = pathlib.Path(sys.argv[1])
checkpoint = Checkpoint(path, OWNER, every=0)
def fill(learner):
    real = learner.step
    def step(batch, now):
        if now.number == 4:
            resource.setrlimit(resource.RLIMIT_FSIZE, (1000, resource.RLIM_INFINITY))
        return real(batch, now)
    learner.step = step
    return learner
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
try:
    train(fill(Fit()), points(), BUDGET, seed=0, checkpoint=checkpoint)
except StorageError as problem:
    assert problem.errno == errno.EFBIG
    print(problem)
"""


def test_a_disk_that_refuses_loses_nothing(tmp_path):
    """A real refusal of the system, by a limit on the size of files: the last checkpoint stays."""
    path = tmp_path / "checkpoint"
    said = subprocess.run(
        [sys.executable, "-c", FULL, str(path)], capture_output=True, text=True, check=True, timeout=120
    ).stdout
    assert f"{path} cannot be written" in said
    assert "make room" in said
    assert len(said.splitlines()) == 1
    assert [one.name for one in tmp_path.iterdir()] == ["checkpoint"]
    assert read_tensors(path)["state"]["step"] == 4
    resumed = train(Fit(), points(), BUDGET, seed=0, checkpoint=Checkpoint(path, OWNER))
    expected = train(Fit(), points(), BUDGET, seed=0)
    assert torch.equal(flat(resumed.weights), flat(expected.weights))


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EROFS])
def test_what_the_system_says_is_passed_on(tmp_path, monkeypatch, number):
    def refuses(file):
        raise OSError(number, "no")

    monkeypatch.setattr("os.fsync", refuses)
    with pytest.raises(StorageError, match=r"cannot be written \(no\)") as problem:
        write_tensors(tmp_path / "weights", {"a": torch.zeros(3)})
    assert problem.value.errno == number
    assert isinstance(problem.value, TrainingError)
    assert isinstance(problem.value, OSError)
    assert list(tmp_path.iterdir()) == []


def test_it_is_written_beside_a_while_after_the_last_time(tmp_path, monkeypatch):
    checkpoint = Checkpoint(tmp_path / "deep" / "down" / "checkpoint", OWNER, every=1e9)
    written = []
    real = checkpoint.write
    monkeypatch.setattr(checkpoint, "write", lambda *given: (written.append(1), real(*given)))
    train(Fit(), points(), BUDGET, seed=0, checkpoint=checkpoint)
    assert written == [1]  # at the end
    checkpoint.every = 0
    checkpoint.remove()
    train(Fit(), points(), BUDGET, seed=0, checkpoint=checkpoint)
    assert len(written) == 1 + BUDGET.steps


def test_limits_are_the_systems_own():
    """Else the test of the full disk would test nothing."""
    assert resource.RLIM_INFINITY in resource.getrlimit(resource.RLIMIT_FSIZE)
    assert signal.SIGXFSZ
