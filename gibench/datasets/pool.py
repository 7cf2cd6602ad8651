"""Worker processes that rooms, or other numbered pieces of work, are handed to, one at a time.

The process that hands out rooms loads no renderer: workers are spawned afresh, replaced after
`ROOMS_PER_WORKER` rooms because a process that loads many scenes grows, and their death costs the room in
hand only.
"""

from __future__ import annotations

import contextlib
import errno
import os
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from typing import Any

from gibench.datasets.errors import BadScene, MakingError, RecipeError
from gibench.errors import GibenchError
from gibench.processes import ChildProcess, ProcessEnded

#: Rooms after which a worker makes way for a fresh one.
ROOMS_PER_WORKER = 25

#: Most workers at the same time; each holds a renderer and some hundred megabytes.
MOST_WORKERS = 1024

#: A worker is given up that neither says anything nor computes for so many seconds: it was stopped, or waits for what
#: never comes.
PATIENCE = 60.0

#: One that computes and says nothing is given up after this many times the longest silence so far, but not before so
#: many seconds: the samples of a frame may differ by a factor of 64 where an error is asked for.
SILENCES, COMPUTING_PATIENCE = 100, 1800.0

#: Stands for the start of a worker among the rooms that one has died in.
HANGING_START = -1

#: Seconds between two looks at workers that say nothing, and of processor time that count as computing.
LOOK_SECONDS, COMPUTING = 2.0, 0.01

#: Sends a message from a job to the process that hands out rooms: (kind of message, content).
Report = Callable[[str, Any], None]


@dataclass(frozen=True)
class Work:
    """The task of a worker. The functions are pickled by name.

    setup: runs once in each worker; what it returns reaches `Listener.ready`. job: does one room; it may
    report on its way, and what it returns reaches `Listener.done`. place: a room as messages call it. again: what a
    user does when a room takes two workers with it. rooms_per_worker: after which a fresh one takes its place.
    """

    setup: Callable[[], Any]
    job: Callable[[int, Report], Any]
    place: Callable[[int], str] = "room {}".format
    again: str = "lower --workers if memory ran out, then run the same command again to continue"
    rooms_per_worker: float = ROOMS_PER_WORKER


@dataclass(frozen=True)
class Listener:
    """Callbacks of the process that hands out rooms. An exception raised in here stops all workers."""

    ready: Callable[[Any], None]
    message: Callable[[int, str, Any], None]
    done: Callable[[int, Any], None]
    died: Callable[[int], None]
    told: Callable[[str], None] = lambda text: None


@dataclass
class _Worker:
    process: ChildProcess
    rooms_left: float
    room: int | None = None
    ready: bool = False
    last_message: float = field(default_factory=time.monotonic)
    last_computed: float = field(default_factory=time.monotonic)
    seconds: float = 0.0
    hung: str = ""

    @property
    def busy(self) -> bool:
        """Whether something is awaited of it."""
        return not self.ready or self.room is not None


def run_rooms(work: Work, rooms: Iterable[int], listener: Listener, *, workers: int = 1) -> None:
    """Do every room, in up to `workers` processes at a time; returns when all are done.

    A room whose worker dies or hangs is tried once more in a fresh one. Raises `MakingError` when it does again, and
    for whatever a job raises (a `GibenchError` keeps its message); a `RecipeError` of the setup stays one. All workers
    are gone when this returns or raises.
    """
    left = deque(rooms)
    deaths: set[int] = set()
    running: list[_Worker] = []
    watch = _Watch()
    try:
        while left or any(worker.room is not None for worker in running):
            idle = sum(worker.room is None for worker in running)
            while len(running) < workers and idle < len(left):
                running.append(_start_worker(work))
                idle += 1
            for worker in running:
                if worker.ready and worker.room is None and left:
                    worker.room = left.popleft()
                    worker.last_message = worker.last_computed = time.monotonic()
                    with contextlib.suppress(OSError):  # it has just died, and is heard of below
                        worker.process.connection.send(worker.room)
            wait([worker.process.connection for worker in running], timeout=LOOK_SECONDS)
            watch.look(running)
            for worker in [w for w in running if w.hung or w.process.connection.poll()]:
                if worker.hung:
                    listener.told(_whose(worker, work) + worker.hung)
                    how = "given up, since each hung"
                else:
                    try:
                        kind, content = worker.process.receive()
                        how = ""
                    except ProcessEnded as end:
                        how = end.how
                if how:
                    worker.process.close()
                    running.remove(worker)
                    left.extendleft(_rooms_to_retry(worker, how, work, deaths, listener))
                    continue
                watch.note_message(worker)
                if _handle(worker, kind, content, listener):
                    running.remove(worker)
    finally:
        for worker in running:
            worker.process.kill()
        for worker in running:
            worker.process.close()


class _Watch:
    """Notices workers that hang: stopped, or waiting for what never comes."""

    def __init__(self) -> None:
        self.longest = 0.0
        self.looked = time.monotonic()

    def note_message(self, worker: _Worker) -> None:
        now = time.monotonic()
        # What the setup takes, which loads a renderer, says nothing about rooms.
        if worker.ready and worker.room is not None:
            self.longest = max(self.longest, now - worker.last_message)
        worker.last_message = worker.last_computed = now

    def look(self, running: list[_Worker]) -> None:
        now = time.monotonic()
        if now - self.looked < LOOK_SECONDS:
            return
        if now - self.looked > 5 * LOOK_SECONDS:  # this process was stopped itself, and so, likely, were they
            for worker in running:
                worker.last_message = worker.last_computed = now
        self.looked = now
        for worker in running:
            seconds = _processor_seconds(worker.process)
            if seconds is None or seconds - worker.seconds > COMPUTING or not worker.busy:
                worker.last_computed, worker.seconds = now, seconds or worker.seconds
            limit = max(COMPUTING_PATIENCE, SILENCES * self.longest) if self.longest else float("inf")
            if not worker.busy or worker.process.connection.poll():
                continue
            silence = now - worker.last_message
            if silence > limit:
                worker.hung = f"said nothing for {silence:.0f} s, {SILENCES} times as long as ever before"
            elif now - worker.last_computed > PATIENCE:
                worker.hung = f"hangs: it has not computed anything for {now - worker.last_computed:.0f} s"


def _processor_seconds(process: ChildProcess) -> float | None:
    """Processor time of a process so far; None where that cannot be known, or it has ended."""
    import psutil

    try:
        times = psutil.Process(process.pid).cpu_times()
    except psutil.Error:
        return None
    return float(times.user + times.system)


def _whose(worker: _Worker, work: Work) -> str:
    return "a worker " if worker.room is None else f"{work.place(worker.room)}: its worker "


def _handle(worker: _Worker, kind: str, content: Any, listener: Listener) -> bool:
    """Pass a message on; True when the worker has done its share and was sent home."""
    if kind == "ready":
        worker.ready = True
        listener.ready(content)
        return False
    if kind == "refused":
        raise RecipeError(content)
    if kind == "failed":
        raise MakingError(content)
    if kind == "bad scene":
        raise BadScene(content)
    assert worker.room is not None
    if kind != "done":
        listener.message(worker.room, kind, content)
        return False
    room, worker.room = worker.room, None
    listener.done(room, content)
    worker.rooms_left -= 1
    if worker.rooms_left > 0:
        return False
    worker.process.end()
    return True


def _rooms_to_retry(worker: _Worker, how: str, work: Work, deaths: set[int], listener: Listener) -> list[int]:
    """Rooms to do again after a worker's death: the one in hand, if any. Raises `MakingError` the second time.

    how: it died.
    """
    if worker.hung and not worker.ready and HANGING_START not in deaths:
        deaths.add(HANGING_START)
        return []
    if not worker.ready:
        raise MakingError(
            f"a worker was {how} before its first room: `gibench doctor` shows whether rendering works"
        )
    if worker.room is None:
        return []
    listener.died(worker.room)
    if worker.room in deaths:
        raise MakingError(f"{work.place(worker.room)}: two workers in a row were {how}; {work.again}")
    deaths.add(worker.room)
    return [worker.room]


def _start_worker(work: Work) -> _Worker:
    return _Worker(ChildProcess(_serve, work), work.rooms_per_worker)


def _serve(connection: Connection, work: Work) -> None:
    """Body of a worker process: set up, then a room after another until the other end closes."""
    room: int | None = None
    try:
        connection.send(("ready", work.setup()))
        while True:
            try:
                room = connection.recv()
            except EOFError:
                return
            connection.send(("done", work.job(room, lambda kind, content: connection.send((kind, content)))))
    except RecipeError as problem:
        connection.send(("refused", str(problem)))
    except Exception as problem:
        if os.environ.get("GIBENCH_DEBUG"):
            traceback.print_exc()
        from gibench.generators.imported.errors import SceneFileError
        from gibench.generators.layouts.placement import RejectedRoom

        with contextlib.suppress(OSError):
            # Rooms that are rejected are left out, but for a scene that is the only one.
            if isinstance(problem, SceneFileError | RejectedRoom):
                connection.send(("bad scene", str(problem)))
            else:
                connection.send(("failed", explained(problem, room, work.place)))


def explained(
    problem: BaseException, room: int | None, named: Callable[[int], str] = "room {}".format
) -> str:
    """A failure in one line, with the room that it happened in."""
    place = "" if room is None else f"{named(room)}: "
    if isinstance(problem, GibenchError):
        return f"{place}{problem}"
    if isinstance(problem, OSError) and problem.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"{place}the disk is full: free some space, then run the same command again to continue"
    if isinstance(problem, OSError) and problem.strerror:
        return f"{place}{problem.filename or 'a file'}: {problem.strerror}"
    text = " ".join(str(problem).split())
    return f"{place}{type(problem).__name__}: {text} (GIBENCH_DEBUG=1 shows the traceback)"
