"""Measured figures of clusters: `pytest -m performance -s tests/performance/test_cluster_speed.py`.

They are ratios within one run, printed with what is to be reached: a busy machine slows both sides of each.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil
import pytest

from gibench.datasets import load_preset, pool
from gibench.datasets.cluster import run_tasks
from gibench.datasets.cluster_opening import opened
from gibench.datasets.making import make
from gibench.datasets.pool import Listener, Report, Work
from gibench.datasets.recipes import Recipe
from gibench.datasets.room_making import Renderer, RoomMaker
from tests.clusters import dask, killed, scheduler, worker
from tests.datasets.fakes import Answer

pytest.importorskip("distributed")
pytestmark = pytest.mark.performance

SLEEPING = 10_000


@dataclass(frozen=True)
class Asleep:
    """A room that takes so many seconds of no core."""

    seconds: float

    def __call__(self, room: int, report: Report) -> dict[str, Any]:
        time.sleep(self.seconds)
        return {"rejections": {}}


@dataclass(frozen=True)
class SameRoom:
    """The first room of a recipe again and again, so that what is compared takes equally long."""

    root: Path
    recipe: Recipe

    def __call__(self, room: int, report: Report) -> dict[str, Any]:
        return RoomMaker(self.root / str(room), self.recipe)(0, report)


class Clock:
    """When tasks were done."""

    def __init__(self) -> None:
        self.began, self.times = time.perf_counter(), []

    def done(self, number: int, content: Any) -> None:
        self.times.append(time.perf_counter())

    @property
    def listener(self) -> Listener:
        return Listener(lambda facts: None, lambda *_: None, self.done, lambda number: None)

    def rate(self, workers: int) -> float:
        """Tasks a second, without those that were done while not all workers were there or busy any more."""
        return (len(self.times) - 2 * workers) / (self.times[-1 - workers] - self.times[workers - 1])


def rate_on_a_cluster(work: Work, rooms: int, workers: int, folder: Path) -> float:
    """Rooms a second by workers of one thread that were started by hand."""
    folder.mkdir()
    file, clock = folder / "scheduler.json", Clock()
    processes = [scheduler(file), *(worker(file, f"{number}", 1) for number in range(workers))]
    try:
        run_tasks(work, range(rooms), clock.listener, cluster=str(file), root=folder)
    finally:
        killed(*processes)
    return clock.rate(workers)


def test_two_workers_of_one_core_make_twice_the_rooms(tmp_path):
    """Against two processes of this machine without Dask, which share its memory and its other load alike."""
    recipe, rooms = load_preset("smoke", {"rooms": 1, "views": 4}), 20
    plain, cluster = {}, {}
    for workers in (1, 2):
        clock = Clock()
        work = Work(Renderer("auto", 1, recipe), SameRoom(tmp_path / f"pool{workers}", recipe))
        pool.run_rooms(work, range(rooms), clock.listener, workers=workers)
        plain[workers] = clock.rate(workers)
        work = Work(Renderer("auto", 1, recipe), SameRoom(tmp_path / f"rooms{workers}", recipe))
        cluster[workers] = rate_on_a_cluster(work, rooms, workers, tmp_path / f"cluster{workers}")
    gain, best = (rates[2] / rates[1] for rates in (cluster, plain))
    print(
        f"\ntwo workers of one core make {gain:.2f} x the rooms of one (reach 1.9 on idle cores); two processes "
        f"without Dask {best:.2f} x: {gain / best:.3f} of that (reach 0.95); {3600 * cluster[2]:.0f} rooms an hour"
    )


def test_two_workers_make_twice_the_rooms_where_no_core_is_shared(tmp_path):
    """Rooms that wait for as long as small ones compute: all that is left is what Dask and handing out cost."""
    work = Work(Answer({}), Asleep(1.0))
    one, two = (rate_on_a_cluster(work, 24, workers, tmp_path / f"{workers}") for workers in (1, 2))
    print(f"\ntwo workers do {two / one:.3f} x the waiting of one (reach 1.9), {two:.3f} s of it a second")


def test_what_dask_costs_of_a_small_room(tmp_path):
    recipe = load_preset("small", {"rooms": 2})
    clock, trivial = Clock(), Work(Answer({}), Answer({}))
    with opened("local:1") as place:
        run_tasks(trivial, range(60), clock.listener, cluster=place, root=tmp_path)
        overhead = 1 / clock.rate(1)
        summary = make(tmp_path / "d", recipe, cluster=place)
    room = sum(summary.totals["room_seconds"].values()) / recipe.rooms
    print(
        f"\na task that does nothing takes {1000 * overhead:.0f} ms, a small room {room:.1f} s: "
        f"{100 * overhead / room:.2f} % (reach 3)"
    )


def test_ten_thousand_rooms_start_at_once_and_the_client_does_not_grow(tmp_path):
    file, clock, megabytes = tmp_path / "scheduler.json", Clock(), []
    processes = [scheduler(file)]
    words = ["worker", "--scheduler-file", str(file), "--nworkers", "2", "--nthreads", "1", "--no-dashboard"]
    processes.append(dask(*words))
    this = psutil.Process()

    def done(number: int, content: Any) -> None:
        clock.done(number, content)
        if len(clock.times) % 500 == 0:
            megabytes.append(this.memory_info().rss / 2**20)

    def ready(facts: Any) -> None:
        clock.began = time.perf_counter()

    listener = Listener(ready, lambda *_: None, done, lambda number: None)
    try:
        work = Work(Answer({}), Asleep(0.01))
        run_tasks(work, range(SLEEPING), listener, cluster=str(file), root=Path(tmp_path))
    finally:
        killed(*processes)
    print(
        f"\nthe first of {SLEEPING} rooms is done {clock.times[0] - clock.began:.2f} s after the workers are ready "
        f"(reach 10); the client holds {megabytes[0]:.0f} MB after 500, {megabytes[-1]:.0f} MB at the end"
    )
    assert len(clock.times) == SLEEPING
