"""Worker processes that rooms are handed to, one at a time.

The process that hands out rooms loads no renderer: workers are spawned afresh, replaced after
`ROOMS_PER_WORKER` rooms because a process that loads many scenes grows, and their death costs the room in
hand only.
"""

from __future__ import annotations

import contextlib
import errno
import multiprocessing
import os
import signal
import threading
import traceback
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any

from gibench.datasets.errors import MakingError, RecipeError
from gibench.errors import GibenchError

#: Rooms after which a worker makes way for a fresh one.
ROOMS_PER_WORKER = 25

#: Sends a message from a job to the process that hands out rooms: (kind of message, content).
Report = Callable[[str, Any], None]


@dataclass(frozen=True)
class Work:
    """What a worker does. Both functions are pickled by name.

    setup: runs once in each worker; what it returns reaches `Listener.ready`. job: does one room; it may
    report on its way, and what it returns reaches `Listener.done`.
    """

    setup: Callable[[], Any]
    job: Callable[[int, Report], Any]


@dataclass(frozen=True)
class Listener:
    """What the process that hands out rooms wants to hear. An exception raised in here stops all workers."""

    ready: Callable[[Any], None]
    message: Callable[[int, str, Any], None]
    done: Callable[[int, Any], None]
    died: Callable[[int], None]


@dataclass
class _Worker:
    process: BaseProcess
    connection: Connection
    room: int | None = None
    ready: bool = False
    rooms_left: int = ROOMS_PER_WORKER


def run_rooms(work: Work, rooms: Iterable[int], listener: Listener, *, workers: int = 1) -> None:
    """Do every room, in up to `workers` processes at a time; returns when all are done.

    A room whose worker dies is tried once more in a fresh one. Raises `MakingError` when it dies again, and
    for whatever a job raises (a `GibenchError` keeps its message); a `RecipeError` of the setup stays one. All workers
    are gone when this returns or raises.
    """
    left = deque(rooms)
    deaths: set[int] = set()
    crew: list[_Worker] = []
    try:
        while left or any(worker.room is not None for worker in crew):
            idle = sum(worker.room is None for worker in crew)
            while len(crew) < workers and idle < len(left):
                crew.append(_hired(work))
                idle += 1
            for worker in crew:
                if worker.ready and worker.room is None and left:
                    worker.room = left.popleft()
                    with contextlib.suppress(OSError):  # it has just died, and is heard of below
                        worker.connection.send(worker.room)
            wait([worker.connection for worker in crew])
            for worker in [w for w in crew if w.connection.poll()]:
                try:
                    kind, content = worker.connection.recv()
                except (EOFError, OSError):
                    crew.remove(worker)
                    left.extendleft(_room_of_the_dead(worker, deaths, listener))
                    continue
                if _heard(worker, kind, content, listener):
                    crew.remove(worker)
    finally:
        for worker in crew:
            worker.process.kill()
        for worker in crew:
            worker.process.join()
            worker.connection.close()


def _heard(worker: _Worker, kind: str, content: Any, listener: Listener) -> bool:
    """Pass a message on; True when the worker has done its share and was sent home."""
    if kind == "ready":
        worker.ready = True
        listener.ready(content)
        return False
    if kind == "refused":
        raise RecipeError(content)
    if kind == "failed":
        raise MakingError(content)
    assert worker.room is not None
    if kind != "done":
        listener.message(worker.room, kind, content)
        return False
    room, worker.room = worker.room, None
    listener.done(room, content)
    worker.rooms_left -= 1
    if worker.rooms_left > 0:
        return False
    worker.connection.close()  # its loop ends there
    worker.process.join()
    return True


def _room_of_the_dead(worker: _Worker, deaths: set[int], listener: Listener) -> list[int]:
    """Rooms to do again after a worker's death: the one in hand, if any. Raises `MakingError` the second time."""
    worker.process.join()
    code = worker.process.exitcode or 0
    how = f"killed by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
    if not worker.ready:
        raise MakingError(
            f"a worker was {how} before its first room: `gibench doctor` shows whether rendering works"
        )
    if worker.room is None:
        return []
    listener.died(worker.room)
    if worker.room in deaths:
        hint = "lower --workers if memory ran out, then run the same command again to continue"
        raise MakingError(f"room {worker.room}: two workers in a row were {how}; {hint}")
    deaths.add(worker.room)
    return [worker.room]


def _hired(work: Work) -> _Worker:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_worker, args=(theirs, work), daemon=True)
    process.start()
    theirs.close()
    return _Worker(process, ours)


def _worker(connection: Connection, work: Work) -> None:
    """Body of a worker process: set up, then a room after another until the other end closes."""
    leave_signals_to_parent()
    threading.Thread(target=end_with_parent, daemon=True).start()
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
        with contextlib.suppress(OSError):
            connection.send(("failed", _explained(problem, room)))


def leave_signals_to_parent() -> None:
    """Ignore what asks to end: it reaches a whole group, and the process that spawned this one decides."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)


def end_with_parent() -> None:
    """Body of a thread that ends this process when the one that spawned it ends, however it does."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)


def _explained(problem: Exception, room: int | None) -> str:
    place = "" if room is None else f"room {room}: "
    if isinstance(problem, GibenchError):
        return f"{place}{problem}"
    if isinstance(problem, OSError) and problem.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"{place}the disk is full: free some space, then run the same command again to continue"
    if isinstance(problem, OSError) and problem.strerror:
        return f"{place}{problem.filename or 'a file'}: {problem.strerror}"
    text = " ".join(str(problem).split())
    return f"{place}{type(problem).__name__}: {text} (GIBENCH_DEBUG=1 shows the traceback)"
