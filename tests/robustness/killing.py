"""Kills commands at random instants, runs them again, and compares what comes of it with an undisturbed run.

``python -m tests.robustness.killing --command make-dataset --kills 50`` kills the command's process, one of its workers
or the whole group, fifty times; a seed that is printed decides how and when. What was whole before a kill is the same
bytes after it, and what comes out in the end is what an undisturbed run makes. `--log FILE` keeps a line for each kill:
what was killed, when, how many files were whole by then, and what was lost.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import psutil

FAKE = """
import sys
from pathlib import Path
from gibench.datasets.making import make
from tests.datasets.fakes import fake_work, tiny
if __name__ == "__main__":
    root, recipe, how = Path(sys.argv[2]), tiny(4), {"workers": 2}
    if sys.argv[1] == "cluster":
        recipe, how = tiny(20), {"cluster": "local:2"}
    make(root, recipe, command="again", work=fake_work(root, recipe, slow=0.05), **how)
"""
GIBENCH = (sys.executable, "-m", "gibench")
TINY = ("--views", "2", "--resolution", "32x24", "--spp", "4", "--channels", "radiance,surface")
BENCH = ("bench", "run", "--preset", "smoke", "--no-score", "--track", "tiny.toml", "--methods")

#: The smoke preset of a track of our own, in which rendering takes as long as starting processes does.
TINY_TRACK = """
id = "walkthrough"
title = "Walkthrough"
question = "Is anything lost?"
varies = ["camera"]
prepared = "for each room"
source = []
parts = ["full"]
metrics = ["rmse"]
sequence_metrics = []
[presets.smoke]
rooms = 1
warmup = 1
budget = { prepare = 600, render = 300 }
[presets.smoke.room]
resolution = [32, 32]
views = 2
path = "walk"
path_views = 2
kinds = ["bathroom"]
[presets.smoke.training]
spp = 4
channels = ["radiance", "surface"]
[presets.smoke.reference]
spp = 4
channels = ["radiance", "position", "shape_id", "motion"]
[presets.smoke.knobs]
texels = 4
lightmap_spp = 16
probes = 8
probe_width = 32
probe_spp = 4
epochs = 20
crop = 32
"""


WHOM = ("command", "worker", "group")


@dataclass(frozen=True)
class Command:
    """words: without the folder, which comes last. whole: files that are never changed once they are there, with what
    they must be in the end; None for content that differs from run to run. before: what all
    rows of kills but the first find there already, so that more of them fall into what comes after it."""

    words: tuple[str, ...]
    whole: Callable[[Path], dict[str, str | None]]
    before: tuple[str, ...] = ()


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _frames(root: Path) -> dict[str, str | None]:
    return {str(path.relative_to(root)): _sha256(path) for path in root.glob("rooms/[0-9]*/frames/*.exr")}


def _results(root: Path) -> dict[str, str | None]:
    found: dict[str, str | None] = {}
    for path in root.glob("results/[0-9a-f]*.json"):
        assert json.loads(path.read_text())["status"] == "ok", path.read_text()[:2000]
        found[str(path.relative_to(root))] = None
    for which in ("reference", "reference-again", "training"):
        found |= {f"{which}/{name}": sha256 for name, sha256 in _frames(root / "scenes" / which).items()}
    return found


COMMANDS = {
    "make-fake": Command((sys.executable, "-c", FAKE, "workers"), _frames),
    "make-fake-cluster": Command((sys.executable, "-c", FAKE, "cluster"), _frames),
    "make-dataset": Command(
        (*GIBENCH, "dataset", "make", "--rooms", "3", "--workers", "2", *TINY, "--out"), _frames
    ),
    "bench": Command((*GIBENCH, *BENCH, "lightmap", "--out"), _results, ("scenes", "run.json")),
    "make-cluster": Command(
        (*GIBENCH, "dataset", "make", "--rooms", "3", "--cluster", "local:2", *TINY, "--out"), _frames
    ),
    "bench-cluster": Command(
        (*GIBENCH, *BENCH, "lightmap", "--cluster", "local:2", "--out"), _results, ("scenes", "run.json")
    ),
    "training": Command((*GIBENCH, *BENCH, "elp", "--out"), _results, ("scenes", "run.json")),
}


@dataclass
class Outcome:
    """kills: that hit a running command. lost: what was wrong, with the kill that it followed."""

    kills: int
    lost: list[str]


def started(command: Command, root: Path) -> subprocess.Popen[str]:
    """Start a command in a process group of its own."""
    return subprocess.Popen(
        [*command.words, str(root)],
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        cwd=root.parent,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    )


def completed(command: Command, root: Path) -> float:
    """Run a command to its end; returns its seconds."""
    began = time.monotonic()
    process = started(command, root)
    _, said = process.communicate(timeout=1200)
    if process.returncode:
        raise RuntimeError(f"{root} cannot be completed: {said[-2000:]}")
    return time.monotonic() - began


def kill(process: subprocess.Popen[str], rng: random.Random, whom: tuple[str, ...] = WHOM) -> str:
    """Kill a command, one of its workers or the group; returns which, empty where it had ended."""
    who = rng.choice(whom)
    if process.poll() is not None:
        return ""
    if who == "group":
        os.killpg(process.pid, signal.SIGKILL)
    elif who == "command":
        process.kill()
    else:
        with contextlib.suppress(psutil.Error):
            children = psutil.Process(process.pid).children(recursive=True)
            if not children and "command" not in whom:
                return ""
            if not children:  # none has been started yet
                process.kill()
                return "command"
            rng.choice(children).kill()
    return who


def killed(
    name: str,
    kills: int,
    seed: int,
    seconds: float = float("inf"),
    told: Callable[[str], None] = lambda line: None,
    whom: tuple[str, ...] = WHOM,
) -> Outcome:
    """Kill a command again and again; see the module. seconds: after which no further kill begins. told: of each."""
    command, rng = COMMANDS[name], random.Random(f"{name}-{seed}")
    outcome = Outcome(0, [])
    end = time.monotonic() + seconds
    with tempfile.TemporaryDirectory(prefix="gibench-kills-") as scratch:
        undisturbed, root = Path(scratch) / "undisturbed", Path(scratch) / "killed"
        (Path(scratch) / "tiny.toml").write_text(TINY_TRACK)
        duration = completed(command, undisturbed)
        expected = command.whole(undisturbed)
        names = _names(undisturbed)
        told(f"seed {seed}; undisturbed in {duration:.1f} s, {len(expected)} files that must not change")
        in_a_row = rows = 0
        shortened = 0.0
        while outcome.kills < kills and time.monotonic() < end:
            given = bool(command.before) and rows > 0
            if given and not root.exists():
                _give(command, undisturbed, root)
                if not shortened:
                    shortened = completed(command, root)
                    shutil.rmtree(root)
                    _give(command, undisturbed, root)
            before = command.whole(root) if root.exists() else {}
            bytes_before = {file: _content(root, file) for file in before}
            process = started(command, root)
            delay = rng.uniform(0, shortened if given else duration)
            began = time.monotonic()
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.communicate(timeout=delay)
            who = kill(process, rng, whom)
            if not who and not in_a_row:  # all of it: machines are not equally busy all the time
                if given:
                    shortened = min(shortened, time.monotonic() - began)
                else:
                    duration = min(duration, time.monotonic() - began)
            # Without its command everything must end: a worker that starts, when it is there. Without a worker, or with
            # nothing to kill, it goes on.
            process.communicate(timeout=300 if who in ("command", "group") else 1200)
            lost_before = len(outcome.lost)
            outcome.kills += bool(who)
            in_a_row += bool(who)
            what = f"kill {outcome.kills} of {kills}: {who} after {delay:.2f} s"
            after = _failed_by_kill_removed(command, root) if root.exists() else {}
            for file, content in bytes_before.items():
                if file not in after or _content(root, file) != content:
                    outcome.lost.append(f"{what}: {file} was whole before and is not the same after")
            if who:
                lost = len(outcome.lost) - lost_before
                told(
                    f"{what}, {len(before)} files whole before and {len(after)} after, {lost or 'nothing'} lost"
                )
            if not who or in_a_row == 8 or outcome.kills == kills:
                in_a_row = 0
                lost_before = len(outcome.lost)
                completed(command, root)
                if command.whole(root) != expected:
                    outcome.lost.append(f"{what}: the result differs from an undisturbed one")
                if others := _names(root) ^ names:
                    outcome.lost.append(f"{what}: files of one run alone: {sorted(others)[:5]}")
                same = len(outcome.lost) == lost_before
                rows += 1
                told(
                    f"run to its end: {'as if undisturbed' if same else '; '.join(outcome.lost[lost_before:])}"
                )
                shutil.rmtree(root)
    return outcome


def _give(command: Command, undisturbed: Path, root: Path) -> None:
    """Let a run find what an undisturbed one has made first."""
    root.mkdir()
    for name in command.before:
        if (undisturbed / name).is_dir():
            shutil.copytree(undisturbed / name, root / name)
        else:
            shutil.copy(undisturbed / name, root / name)


def _failed_by_kill_removed(command: Command, root: Path) -> dict[str, str | None]:
    """What is whole. A result whose own process was killed has failed for that reason, and is tried again."""
    for path in root.glob("results/[0-9a-f]*.json"):
        record = json.loads(path.read_text())
        if record["status"] == "failed":
            assert "killed by SIGKILL" in record["reason"], record["reason"]
            path.unlink()
    return command.whole(root)


def _content(root: Path, file: str) -> str:
    path = root / file
    return _sha256(path if path.exists() else root / "scenes" / file)


def _names(root: Path) -> set[str]:
    """Of all files that a run leaves, but for what carries a number of its own."""
    return {str(path.relative_to(root)) for path in root.rglob("*") if path.is_file()}


def main() -> None:
    """Kill as the command line says; end with code 1 where anything was lost."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--command", action="append", choices=list(COMMANDS))
    parser.add_argument("--whom", action="append", choices=WHOM, help="all unless it is said")
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(2**32))
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--log", type=Path, help="a file that a line is added to for each kill")
    asked = parser.parse_args()
    lost = 0
    for name in asked.command or COMMANDS:

        def told(line: str, name: str = name) -> None:
            line = f"{datetime.now().isoformat(timespec='seconds')} {name}: {line}"
            print(line, flush=True)
            if asked.log is not None:
                with asked.log.open("a", encoding="utf-8") as log:
                    print(line, file=log)

        outcome = killed(name, asked.kills, asked.seed, asked.seconds, told, tuple(asked.whom or WHOM))
        told(f"{outcome.kills} kills, seed {asked.seed}, {len(outcome.lost)} losses")
        lost += len(outcome.lost)
    sys.exit(1 if lost else 0)


if __name__ == "__main__":
    main()
