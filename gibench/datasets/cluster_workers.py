"""What runs in the workers of a cluster: looking at them, making them ready, doing a task."""

from __future__ import annotations

import contextlib
import dataclasses
import importlib.metadata
import multiprocessing
import platform
import secrets
import threading
import time
from pathlib import Path
from typing import Any

from gibench.datasets.errors import MakingError
from gibench.datasets.pool import Report, Work, explained

#: What a worker can do once at a time, whatever number of threads it has: one renderer uses all of them.
RENDERER = "gibench-renderer"

#: Packages whose versions must be those of the client: they decide what the pixels are.
DECIDING = (
    "gibench",
    "mitsuba",
    "drjit",
    "mitsuba-oidn",
    "numpy",
    "scipy",
    "shapely",
    "trimesh",
    "colour-science",
)

#: What workers say beside what a job reports.
BEGUN, DONE = "begun", "done"

#: Most seconds that a task waits until the word has left that it has begun.
SENDING_SECONDS = 5.0

#: What this process of a worker was made ready with, and what came of it.
_ready: dict[str, Any] = {}


class Unwanted(MakingError):
    """Whoever asked for a task is gone."""


class Elsewhere(MakingError):
    """A task came to a worker that may not do it."""


def one_renderer() -> list[Any]:
    """Plugins that give every worker, later and restarted ones too, the resource that one task at a time takes."""
    from distributed import NannyPlugin, WorkerPlugin

    class OfWorkers(WorkerPlugin):
        name = "gibench"

        async def setup(self, worker: Any) -> None:
            await worker.set_resources(**{RENDERER: 1})

    class OfNannies(NannyPlugin):
        # A worker that comes back must have it from its first moment: tasks that nobody can do are looked at again
        # when a worker joins, not when one is given something.
        name = "gibench-nanny"
        restart = False

        def setup(self, nanny: Any) -> None:
            nanny.resources = {**(nanny.resources or {}), RENDERER: 1}
            if nanny.process is not None:
                nanny.process.worker_kwargs["resources"] = nanny.resources

    return [OfNannies(), OfWorkers()]


def examined(token: str) -> dict[str, Any]:
    """Whether this worker sees the folder, and what it would render with."""
    path = Path(token)
    return {
        "sees": path.is_file() and path.read_text(encoding="utf-8") == path.name,
        "versions": versions(),
        "host": platform.node(),
    }


def versions() -> dict[str, str]:
    """Of the packages that decide what the pixels are."""
    found = {}
    for name in DECIDING:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            found[name] = importlib.metadata.version(name)
    return found


def made_ready(setup: Any) -> Any:
    """Run a setup once in this process, with the threads that the worker was given."""
    from distributed import get_worker

    # Nannies start workers as daemons, which may start no process: here they watch those that measure.
    multiprocessing.current_process().daemon = False
    if dataclasses.is_dataclass(setup) and hasattr(setup, "threads"):
        setup = dataclasses.replace(setup, threads=get_worker().state.nthreads)  # type: ignore[type-var]
    key = repr(setup)
    if key not in _ready:
        _ready.clear()
        _ready[key] = setup()
    return _ready[key]


def do_task(work: Work, number: int, name: str, token: str, facts: dict[str, Any] | None) -> None:
    """Do one task, unless whoever asked for it is gone.

    facts: what the setup must answer here too; None where workers may differ.
    """
    from distributed import get_worker

    worker, attempt, wanted = get_worker(), secrets.token_hex(4), Path(token)
    key = worker.get_current_task()

    def report(kind: str, content: Any) -> None:
        # A run that ends takes its token away; of one that is killed the scheduler knows, and gives its tasks up.
        task = worker.state.tasks.get(key)
        if not wanted.exists() or task is None or task.state != "executing":
            raise Unwanted(f"{name}: the run that asked for it is gone")
        if kind:
            worker.log_event(wanted.name, (number, attempt, kind, content))

    if not wanted.exists():
        raise MakingError(
            f"worker {worker.address} does not see {wanted.parent}: every worker needs this folder under the same path"
        )
    mine = made_ready(work.setup)
    if facts is not None and mine != facts:
        differing = [key for key in {**facts, **mine} if facts.get(key) != mine.get(key)]
        raise MakingError(
            f"worker {worker.address} would make other pixels ({', '.join(differing)} differ): take it out of the "
            "cluster, then run the same command again to continue"
        )
    said = worker.batched_stream.message_count
    report(BEGUN, None)
    _wait_until_sent(worker, said + 1)
    try:
        report(DONE, work.job(number, report))
    except Elsewhere:
        raise
    except Exception as problem:
        raise MakingError(
            explained(problem, None if isinstance(problem, Unwanted) else number, lambda _: name)
        ) from None


def _wait_until_sent(worker: Any, messages: int) -> None:
    """Wait until so many messages have left this process: one that dies at once would take the word with it."""
    stream, sent = worker.batched_stream, threading.Event()
    end = time.monotonic() + SENDING_SECONDS

    def look() -> None:
        # What is in the buffer no more was handed to the system before this loop came here.
        if (stream.message_count >= messages and not stream.buffer) or time.monotonic() > end:
            sent.set()
        else:
            worker.loop.call_later(0.001, look)

    worker.loop.add_callback(look)
    sent.wait(SENDING_SECONDS)


def still_wanted(report: Report) -> bool:
    """Whether whoever asked for a task is still there. report: what its job was given."""
    try:
        report("", None)
    except Unwanted:
        return False
    return True
