"""Rooms on a Dask cluster: each is a task, which one worker at a time does as a local one would.

Workers write into the same folder by the same write-and-rename, so a run on a cluster, a local one and one that was
resumed make the same files, and any of them continues another. Dask schedules: it gives the rooms of a worker that
dies to another, and gives a room up that takes three workers with it.
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib.metadata
import logging
import os
import queue
import secrets
import time
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gibench.datasets.errors import ClusterError, MakingError
from gibench.datasets.pool import MOST_WORKERS, Listener, Work, explained

if TYPE_CHECKING:
    from distributed import Client, Future

#: Seconds that a scheduler and its first worker may take to answer, and a scheduler that was lost to come back.
PATIENCE = 60.0

#: Workers that a room may take with it: the third time it is set aside.
DEATHS = 3

#: Seconds without a sign of life after which a worker of a local cluster is given up.
SILENCE = 60.0

#: Seconds between two looks at how many workers there are.
LOOK_SECONDS = 0.5

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

#: What this process of a worker was made ready with, and what came of it.
_ready: dict[str, Any] = {}


def run_rooms(work: Work, rooms: Iterable[int], listener: Listener, *, cluster: str, root: Path) -> None:
    """Do every room on a cluster; returns when all are done or set aside. The counterpart of `pool.run_rooms`.

    cluster: "local:N", the address of a scheduler, or the path of a scheduler's file. root: the dataset's folder, which
    every worker must see under the same path. A scheduler that is lost may come back within `PATIENCE` seconds.

    Raises `ClusterError`: nobody listens, no workers, workers that are refused (with their address), no Dask; and
    `MakingError` as `pool.run_rooms` does.
    """
    left = deque(rooms)
    token = root / f".cluster-{secrets.token_hex(8)}.partial-{os.getpid()}"
    token.write_text(token.name, encoding="utf-8")
    try:
        lost = False
        while left:
            with _connected(cluster, len(left), lost=lost) as client:
                run = _Rooms(client, work, listener, token)
                run.prepare()
                left, lost = deque(run.do(left)), True
    finally:
        token.unlink(missing_ok=True)  # which stops workers that still do a room at its next frame


class _Rooms:
    """Rooms handed to one scheduler for as long as it lives."""

    def __init__(self, client: Client, work: Work, listener: Listener, token: Path) -> None:
        self.client, self.work, self.listener, self.token = client, work, listener, token
        self.heard: queue.SimpleQueue[tuple[int, str, str, Any]] = queue.SimpleQueue()
        self.tries: dict[int, str] = {}
        self.begun: Counter[int] = Counter()
        self.facts: dict[str, Any] = {}

    def prepare(self) -> None:
        """Make all workers that are there ready. Raises ClusterError with the address of one that cannot be used."""
        client = self.client
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise ClusterError(
                f"the scheduler at {client.scheduler.address} has no workers: start some with "
                f"`dask worker {client.scheduler.address}`"
            ) from None
        for plugin in _one_renderer():
            client.register_plugin(plugin)
        client.subscribe_topic(self.token.name, lambda event: self.heard.put(event[1]))
        addresses = self._workers()
        answers = client.run(_examined, str(self.token), on_error="return")
        here = _versions()
        for address in addresses:
            _refuse_other(address, answers.get(address), here)
        readying = {
            address: client.submit(
                _made_ready,
                self.work.setup,
                key=f"renderer-{address}-{secrets.token_hex(4)}",
                workers=[address],
                resources={RENDERER: 1},
            )
            for address in addresses
        }
        while readying:
            there = self._workers()
            for address, future in list(readying.items()):
                if future.status in ("finished", "error"):
                    self._take(address, readying.pop(address))
                elif address not in there:
                    del readying[address]
            time.sleep(LOOK_SECONDS)
        if not self.facts:
            raise ClusterError(
                "all workers died before they could render: `gibench doctor` on their machines says why"
            )

    def _take(self, address: str, ready: Future) -> None:
        try:
            self.facts = ready.result()
        except Exception as problem:
            raise ClusterError(f"worker {address} cannot render: {explained(problem, None)}") from None
        self.listener.ready(self.facts)

    def do(self, left: deque[int]) -> list[int]:
        """Returns the rooms that are still to be done when the scheduler is lost; none when all are done."""
        waiting: dict[int, Future] = {}
        workers, looked = 0, 0.0
        try:
            while left or waiting:
                if time.monotonic() - looked > LOOK_SECONDS:
                    try:
                        workers = len(self._workers())
                    except (OSError, TimeoutError):
                        return [*waiting, *left]
                    looked = time.monotonic()
                # One a worker: a room that waits behind one that kills the worker would be suspected with it.
                while left and len(waiting) < workers:
                    room = left.popleft()
                    waiting[room] = self._handed_out(room)
                for room in self._listen():
                    if room in waiting:
                        waiting.pop(room).release()
                    elif room in left:  # done for the client that the scheduler lost before
                        left.remove(room)
                if self.client.status != "running":
                    return [*waiting, *left]
                for room in [room for room, future in waiting.items() if future.status != "pending"]:
                    if waiting[room].status in ("cancelled", "lost"):
                        return [*waiting, *left]
                    if waiting[room].status == "error" and self._is_to_be_tried(room, waiting.pop(room)):
                        left.append(room)
                time.sleep(0.02)
            return []
        finally:
            if self.client.status == "running":
                with contextlib.suppress(OSError, TimeoutError):
                    self.client.cancel(list(waiting.values()), force=True)

    def _workers(self) -> list[str]:
        """Addresses of the workers. Raises OSError or TimeoutError where the scheduler is gone."""
        if self.client.status != "running":
            raise OSError("the scheduler is gone")
        answer = self.client.sync(self.client.scheduler.ncores, callback_timeout=PATIENCE / 4)
        return list(answer)

    def _handed_out(self, room: int) -> Future:
        return self.client.submit(
            _do_room,
            self.work,
            room,
            str(self.token),
            self.facts,
            key=f"room-{room:06d}-{self.token.name[9:17]}{self.begun[room]}",
            resources={RENDERER: 1},
            priority=-room,
        )

    def _listen(self) -> list[int]:
        """Pass on what workers have said; returns the rooms that are done.

        A room counts as done when its worker says so: what a task returns dies with the worker that holds it.
        """
        done = []
        with contextlib.suppress(queue.Empty):
            while True:
                room, attempt, kind, content = self.heard.get_nowait()
                if self.tries.get(room) == DONE:
                    continue
                if self.tries.get(room, attempt) != attempt:
                    self.listener.died(room)
                self.tries[room] = attempt
                if kind == DONE:
                    self.tries[room] = DONE
                    self.listener.done(room, content)
                    done.append(room)
                elif kind == BEGUN:
                    self.begun[room] += 1
                else:
                    self.listener.message(room, kind, content)
        return done

    def _is_to_be_tried(self, room: int, future: Future) -> bool:
        """Whether a room that Dask gave up was only near others that killed its workers."""
        from distributed import KilledWorker

        problem = future.exception()
        if not isinstance(problem, KilledWorker):
            raise MakingError(
                str(problem) if isinstance(problem, MakingError) else explained(problem, room)
            ) from None
        self.listener.died(room)
        if self.begun[room] < DEATHS:
            return True
        why = f"{DEATHS} workers that made it died; make it alone to see why"
        self.listener.done(room, {"rejected": why})
        return False


def _one_renderer() -> list[Any]:
    """Plugins that give every worker, later and restarted ones too, the resource that one room at a time takes."""
    from distributed import NannyPlugin, WorkerPlugin

    class OfWorkers(WorkerPlugin):
        name = "gibench"

        async def setup(self, worker: Any) -> None:
            await worker.set_resources(**{RENDERER: 1})

    class OfNannies(NannyPlugin):
        # A worker that comes back must have it from its first moment: rooms that nobody can do are looked at again
        # when a worker joins, not when one is given something.
        name = "gibench-nanny"
        restart = False

        def setup(self, nanny: Any) -> None:
            nanny.resources = {**(nanny.resources or {}), RENDERER: 1}
            if nanny.process is not None:
                nanny.process.worker_kwargs["resources"] = nanny.resources

    return [OfNannies(), OfWorkers()]


# ---- on the workers


def _examined(token: str) -> dict[str, Any]:
    """Whether this worker sees the folder, and what it would render with."""
    path = Path(token)
    sees = path.is_file() and path.read_text(encoding="utf-8") == path.name
    return {
        "sees": sees,
        "versions": _versions(),
        "host": os.uname().nodename if hasattr(os, "uname") else "",
    }


def _versions() -> dict[str, str]:
    found = {}
    for name in DECIDING:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            found[name] = importlib.metadata.version(name)
    return found


def _made_ready(setup: Any) -> Any:
    """Run a setup once in this process, with the threads that the worker was given."""
    from distributed import get_worker

    if dataclasses.is_dataclass(setup) and hasattr(setup, "threads"):
        setup = dataclasses.replace(setup, threads=get_worker().state.nthreads)  # type: ignore[type-var]
    key = repr(setup)
    if key not in _ready:
        _ready.clear()
        _ready[key] = setup()
    return _ready[key]


def _do_room(work: Work, room: int, token: str, facts: dict[str, Any]) -> None:
    """Do one room, unless whoever asked for it is gone."""
    from distributed import get_worker

    worker, attempt = get_worker(), secrets.token_hex(4)

    def report(kind: str, content: Any) -> None:
        if not Path(token).exists():
            raise MakingError(f"room {room}: the run that asked for it is gone")
        worker.log_event(Path(token).name, (room, attempt, kind, content))

    if not Path(token).exists():
        raise MakingError(
            f"worker {worker.address} does not see {Path(token).parent}: every worker needs the folder of the dataset "
            "under the same path"
        )
    mine = _made_ready(work.setup)
    if mine != facts:
        differing = [key for key in {**facts, **mine} if facts.get(key) != mine.get(key)]
        raise MakingError(
            f"worker {worker.address} would make other pixels ({', '.join(differing)} differ): take it out of the "
            "cluster, then run the same command again to continue"
        )
    report(BEGUN, None)
    time.sleep(0.02)  # a worker that dies at once would take the word with it
    try:
        report(DONE, work.job(room, report))
    except Exception as problem:
        raise MakingError(explained(problem, room)) from None


# ---- on the client


@contextlib.contextmanager
def _connected(cluster: str, rooms: int, *, lost: bool) -> Iterator[Client]:
    """A client of the cluster; one that was made for it ends with it. lost: whether its scheduler was there before."""
    try:
        import dask
        import distributed
    except ImportError:
        raise ClusterError("--cluster needs Dask: pip install 'gibench[cluster]'") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    name, _, number = cluster.partition(":")
    settings = {
        "distributed.scheduler.allowed-failures": DEATHS - 1,
        "distributed.scheduler.worker-ttl": f"{SILENCE:.0f} s",
        "distributed.comm.timeouts.connect": f"{PATIENCE:.0f} s",
    }
    with contextlib.ExitStack() as stack:
        if name == "local":
            if not (number.isascii() and number.isdigit() and 1 <= int(number) <= MOST_WORKERS):
                raise ClusterError(
                    f"--cluster: '{cluster}' is not allowed; write local:N with N from 1 to {MOST_WORKERS}"
                )
            workers = min(int(number), max(rooms, 1))
            stack.enter_context(dask.config.set(settings))
            there: Any = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=workers,
                    threads_per_worker=max(1, (os.cpu_count() or 1) // int(number)),
                    processes=True,
                    dashboard_address=":0",
                    silence_logs=logging.CRITICAL,
                )
            )
            yield stack.enter_context(distributed.Client(there, set_as_default=False))
            return
        place = {"scheduler_file": cluster} if cluster.endswith(".json") else {"address": cluster}
        if cluster.endswith(".json") and not Path(cluster).is_file():
            raise ClusterError(
                f"--cluster: there is no scheduler file {cluster}: `dask scheduler` writes one"
            )
        try:
            client = distributed.Client(**place, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as problem:
            if lost:
                raise ClusterError(
                    f"the scheduler at {cluster} is gone: start it again, then run the same command again to continue"
                ) from None
            raise ClusterError(
                f"--cluster: nobody answers at {cluster} ({' '.join(str(problem).split())[:200]}): start a scheduler "
                "with `dask scheduler`, or write local:N"
            ) from None
        try:
            yield client
        finally:
            client.close(timeout=2)


def _refuse_other(address: str, answer: Any, here: dict[str, str]) -> None:
    if not isinstance(answer, dict):
        reason = " ".join(str(answer).split()) or "no answer"
        raise ClusterError(
            f"worker {address} cannot be used: {reason}; it needs this gibench: pip install gibench"
        )
    if not answer["sees"]:
        raise ClusterError(
            f"worker {address} on {answer['host']} does not see the folder of the dataset: every worker needs it under "
            "the same path, on a disk that all share"
        )
    there = answer["versions"]
    if differing := [name for name in DECIDING if there.get(name) != here.get(name)]:
        listed = "; ".join(f"{n}: {there.get(n)} there, {here.get(n)} here" for n in differing)
        raise ClusterError(
            f"worker {address} on {answer['host']} would make other pixels ({listed}): pip install the same"
        )
