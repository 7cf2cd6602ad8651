"""SIGTERM and SIGHUP end a command as tidily as Ctrl-C."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from gibench.datasets import open_dataset
from gibench.datasets.folder import LOCK, whole_rooms
from gibench.datasets.manifest import read_manifest
from gibench.datasets.verifying import verify

PROGRAM = """
import signal
import sys
from pathlib import Path
import typer
from gibench.cli import run
from gibench.datasets.making import make
from tests.datasets.fakes import fake_work, tiny

app = typer.Typer()

@app.command()
def go(root: Path, slow: float) -> None:
    recipe = tiny(4)
    make(root, recipe, workers=2, command="again", work=fake_work(root, recipe, slow=slow))

if __name__ == "__main__":
    if "nohup" in sys.argv:
        sys.argv.remove("nohup")
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    sys.exit(run(app))
"""


def started(tmp_path: Path, slow: float, *words: str) -> tuple[Path, subprocess.Popen]:
    (tmp_path / "program.py").write_text(PROGRAM)
    root = tmp_path / "d"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    process = subprocess.Popen(
        [sys.executable, tmp_path / "program.py", root, str(slow), *words],
        start_new_session=True,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        cwd=Path(__file__).parents[2],
    )
    end = time.monotonic() + 60
    while not whole_rooms(root):
        assert process.poll() is None
        assert time.monotonic() < end
        time.sleep(0.01)
    return root, process


@pytest.mark.parametrize(
    ("number", "code", "whole_group"),
    [(signal.SIGTERM, 143, False), (signal.SIGTERM, 143, True), (signal.SIGHUP, 129, True)],
)
def test_a_signal_to_end_leaves_what_is_whole_in_order(tmp_path, number, code, whole_group):
    root, process = started(tmp_path, 0.2)
    (os.killpg if whole_group else os.kill)(process.pid, number)
    _, said = process.communicate(timeout=30)
    assert process.returncode == code
    assert said.strip().startswith("error: stopped with")
    assert said.strip().endswith("of 4 rooms whole; to continue run `again`")
    assert not list((root / "rooms").glob(".*"))
    assert not (root / LOCK).exists()
    assert 2 <= len(open_dataset(root)) < 8
    assert not read_manifest(root)["runs"][-1]["ended"]
    _, process = started(tmp_path, 0.0)
    process.communicate(timeout=60)
    assert process.returncode == 0
    assert verify(root) == []


def test_what_nohup_ignores_stays_ignored(tmp_path):
    root, process = started(tmp_path, 0.1, "nohup")
    os.killpg(process.pid, signal.SIGHUP)
    process.communicate(timeout=60)
    assert process.returncode == 0
    assert verify(root) == []
