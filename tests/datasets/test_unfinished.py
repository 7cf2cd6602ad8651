"""Frames of rooms that a run was stopped in."""

from __future__ import annotations

import errno
import json
import os
import signal
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from gibench.datasets import folder, pool, unfinished
from gibench.datasets.errors import MakingError
from gibench.datasets.making import make
from gibench.datasets.pool import Report
from gibench.datasets.room_making import RoomMaker
from gibench.datasets.verifying import verify
from tests.datasets.fakes import Setup, fake_work, tiny

COSTLY = unfinished.WORTH_KEEPING / 3
RECIPE = tiny(2, views=6)


@dataclass
class StoppedAt:
    """A job that stops at a frame of room 0, once: by a signal, or by an error; it writes down which it rendered."""

    job: RoomMaker
    frame: int
    how: int | Exception | None = None

    @property
    def tally(self) -> Path:
        return self.job.root.parent / "tally"

    def __call__(self, room: int, report: Report) -> Any:
        seen = 0

        def told(kind: str, content: Any) -> None:
            nonlocal seen
            seen += 1
            with self.tally.open("a") as file:
                file.write("rendered\n" if content["paths"] else "found\n")
            once = self.job.root.parent / "once"
            if room == 0 and seen == self.frame and self.how is not None and not once.exists():
                once.touch()
                if isinstance(self.how, Exception):
                    raise self.how
                os.kill(os.getpid(), self.how)
            report(kind, content)

        return self.job(room, told)


def contents(root: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted((root / "rooms" / "000000" / "frames").iterdir())}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> dict[str, bytes]:
    root = tmp_path_factory.mktemp("undisturbed") / "data"
    make(root, RECIPE, work=fake_work(root, RECIPE))
    return contents(root)


def stopped(root: Path, frame: int = 5, seconds: float = COSTLY) -> StoppedAt:
    """A dataset whose disk was full in the first room."""
    job = StoppedAt(RoomMaker(root, RECIPE), frame, OSError(errno.ENOSPC, "No space left on device"))
    with pytest.raises(MakingError, match="the disk is full"):
        make(root, RECIPE, work=pool.Work(Setup(seconds=seconds), job))
    return job


def finished(root: Path, job: StoppedAt) -> list[str]:
    job.tally.unlink()
    make(root, RECIPE, work=pool.Work(Setup(seconds=COSTLY), StoppedAt(job.job, 0)))
    assert verify(root) == []
    assert not list((root / "rooms").glob(".*"))
    return job.tally.read_text().split()[: RECIPE.views]


def test_the_frames_of_a_killed_worker_are_not_rendered_again(tmp_path, undisturbed):
    root = tmp_path / "data"
    job = StoppedAt(RoomMaker(root, RECIPE), 5, signal.SIGKILL)
    make(root, RECIPE, work=pool.Work(Setup(seconds=COSTLY), job))
    told = job.tally.read_text().split()
    assert told[:5] == ["rendered"] * 5
    # The last two of the five may not have been written yet.
    found = told[5 : 5 + RECIPE.views].count("found")
    assert found in (3, 4)
    assert contents(root) == undisturbed
    assert verify(root) == []
    assert not list((root / "rooms").glob(".*"))


def test_a_run_goes_on_with_the_frames_of_the_one_before_it(tmp_path, undisturbed):
    root = tmp_path / "data"
    job = stopped(root)
    assert unfinished.unfinished_rooms(root) == {0: 4}
    assert folder.whole_rooms(root) == []
    assert {problem.file for problem in verify(root)} >= {"dataset.json", "rooms/000000"}
    assert finished(root, job) == ["found"] * 4 + ["rendered"] * 2
    assert contents(root) == undisturbed


def test_what_took_no_time_is_not_kept(tmp_path):
    root = tmp_path / "data"
    stopped(root, seconds=unfinished.WORTH_KEEPING / 100)
    assert not (root / "rooms").exists()


def test_frames_that_are_stopped_twice_gather(tmp_path, undisturbed):
    root = tmp_path / "data"
    first = stopped(root, 4)
    (tmp_path / "once").unlink()
    stopped(root, 6)
    assert unfinished.unfinished_rooms(root) == {0: 5}
    assert finished(root, first) == ["found"] * 5 + ["rendered"]
    assert contents(root) == undisturbed


def test_a_frame_that_is_not_what_it_was_is_rendered_again(tmp_path, undisturbed):
    root = tmp_path / "data"
    job = stopped(root, 6)
    waiting = unfinished.unfinished_folder(root, 0)
    damaged, missing, elsewhere = (waiting / "frames" / f"000{view}.exr" for view in range(3))
    damaged.write_bytes(damaged.read_bytes()[:-1] + b"\0")
    missing.unlink()
    elsewhere.rename(tmp_path / "mine.exr")
    elsewhere.symlink_to(tmp_path / "mine.exr")
    journal = waiting / unfinished.JOURNAL
    records = [json.loads(line) for line in journal.read_text().splitlines()]
    records[3]["fov"] += 1e-9
    journal.write_text("\n".join(map(json.dumps, records)) + '\n{"view": 5, "fil')
    assert finished(root, job) == [*["rendered"] * 4, "found", "rendered"]
    assert contents(root) == undisturbed
    assert (tmp_path / "mine.exr").exists()


@pytest.mark.parametrize(
    "line",
    [
        "",
        "[]",
        "null",
        '{"view": 0}',
        '{"view": 0, "file": "../x.exr", "sha256": "", "bytes": 1, "seconds": 1.0}',
        "\0",
    ],
)
def test_lines_of_others_wait_for_nobody(tmp_path, line):
    waiting = unfinished.unfinished_folder(tmp_path, 3)
    (waiting / "frames").mkdir(parents=True)
    (waiting / unfinished.JOURNAL).write_text(line + "\n")
    assert unfinished.unfinished_rooms(tmp_path) == {}
    assert unfinished.WaitingFrames(tmp_path, 3).take({"view": 0}, tmp_path) is None


def test_nothing_is_kept_or_removed_through_a_link(tmp_path):
    root = tmp_path / "data"
    stopped(root)
    waiting, mine = unfinished.unfinished_folder(root, 0), tmp_path / "mine"
    waiting.rename(mine)
    waiting.symlink_to(mine)
    assert unfinished.unfinished_rooms(root) == {}
    before = sorted(path.name for path in mine.rglob("*"))
    make(root, RECIPE, work=fake_work(root, RECIPE))
    assert sorted(path.name for path in mine.rglob("*")) == before
