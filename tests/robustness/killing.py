"""Kills commands at random instants, runs them again, and compares what comes of it with an undisturbed run.

``python -m tests.robustness.killing --command make-dataset --kills 50`` kills the command's process, one of its workers
or the whole group, fifty times; a seed that is printed decides how and when. What was whole before a kill is the same
bytes after it, and what comes out in the end is what an undisturbed run makes.
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
from pathlib import Path

import psutil

FAKE = """
import sys
from pathlib import Path
from gibench.datasets.making import make
from tests.datasets.fakes import fake_work, tiny
if __name__ == "__main__":
    root, recipe = Path(sys.argv[1]), tiny(4)
    make(root, recipe, workers=2, command="again", work=fake_work(root, recipe, slow=0.05))
"""
GIBENCH = (sys.executable, "-m", "gibench")
TINY = ("--views", "2", "--resolution", "32x24", "--spp", "4", "--channels", "radiance,surface")
BENCH = ("bench", "run", "--preset", "smoke", "--rooms", "1", "--no-score", "--methods")


@dataclass(frozen=True)
class Command:
    """words: without the folder, which comes last. whole: files that are never changed once they are there, with what
    they must be in the end; None for content that differs from run to run."""

    words: tuple[str, ...]
    whole: Callable[[Path], dict[str, str | None]]


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
    "make-fake": Command((sys.executable, "-c", FAKE), _frames),
    "make-dataset": Command(
        (*GIBENCH, "dataset", "make", "--rooms", "3", "--workers", "2", *TINY, "--out"), _frames
    ),
    "bench": Command((*GIBENCH, *BENCH, "lightmap,path-traced,nearest-probe", "--out"), _results),
    "training": Command((*GIBENCH, *BENCH, "elp", "--out"), _results),
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
        cwd=Path(__file__).parents[2],
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


def kill(process: subprocess.Popen[str], rng: random.Random) -> str:
    """Kill a command, one of its workers or the group; returns which, empty where it had ended."""
    who = rng.choice(("command", "worker", "group"))
    if process.poll() is not None:
        return ""
    if who == "group":
        os.killpg(process.pid, signal.SIGKILL)
    elif who == "command":
        process.kill()
    else:
        with contextlib.suppress(psutil.Error):
            children = psutil.Process(process.pid).children(recursive=True)
            if not children:
                return ""
            rng.choice(children).kill()
    return who


def killed(name: str, kills: int, seed: int, seconds: float = float("inf")) -> Outcome:
    """Kill a command again and again; see the module. seconds: after which no further kill begins."""
    command, rng = COMMANDS[name], random.Random(f"{name}-{seed}")
    outcome = Outcome(0, [])
    end = time.monotonic() + seconds
    with tempfile.TemporaryDirectory(prefix="gibench-kills-") as scratch:
        undisturbed, root = Path(scratch) / "undisturbed", Path(scratch) / "killed"
        duration = completed(command, undisturbed)
        expected = command.whole(undisturbed)
        names = _names(undisturbed)
        in_a_row = 0
        while outcome.kills < kills and time.monotonic() < end:
            before = command.whole(root) if root.exists() else {}
            bytes_before = {file: _content(root, file) for file in before}
            process = started(command, root)
            delay = rng.uniform(0, 1.1 * duration)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.communicate(timeout=delay)
            who = kill(process, rng)
            # Without its command everything must end soon. Without a worker, or with nothing to kill, it goes on.
            process.communicate(timeout=60 if who in ("command", "group") else 1200)
            what = f"kill {outcome.kills} ({who} after {delay:.2f} s)"
            if who:
                outcome.kills += 1
                in_a_row += 1
                print(f"{name}: {what}", file=sys.stderr, flush=True)
            after = _failed_by_kill_removed(command, root) if root.exists() else {}
            for file, content in bytes_before.items():
                if file not in after or _content(root, file) != content:
                    outcome.lost.append(f"{what}: {file} was whole before and is not the same after")
            if not who or in_a_row == 5 or outcome.kills == kills:
                in_a_row = 0
                completed(command, root)
                if command.whole(root) != expected:
                    outcome.lost.append(f"{what}: the result differs from an undisturbed one")
                if others := _names(root) ^ names:
                    outcome.lost.append(f"{what}: files of one run alone: {sorted(others)[:5]}")
                shutil.rmtree(root)
    return outcome


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
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(2**32))
    parser.add_argument("--seconds", type=float, default=float("inf"))
    asked = parser.parse_args()
    lost = 0
    for name in asked.command or COMMANDS:
        outcome = killed(name, asked.kills, asked.seed, asked.seconds)
        print(f"{name}: {outcome.kills} kills, seed {asked.seed}, {len(outcome.lost)} losses", flush=True)
        print(*outcome.lost, sep="\n", end="\n" if outcome.lost else "", flush=True)
        lost += len(outcome.lost)
    sys.exit(1 if lost else 0)


if __name__ == "__main__":
    main()
