"""Tasks on a Dask cluster: a room, a training, a result, which one worker at a time does as a local process would.

Workers write into the same folder by the same write-and-rename, so a run on a cluster, a local one and one that was
resumed make the same files, and any of them continues another. Each worker has one task in hand; Dask carries it there
and tells when the worker is gone, and then it goes to another, unless it has taken three with it.
"""

from __future__ import annotations

import contextlib
import queue
import secrets
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gibench.datasets import cluster_opening as opening
from gibench.datasets import cluster_workers as workers
from gibench.datasets.cluster_workers import BEGUN, DONE, RENDERER
from gibench.datasets.errors import ClusterError, MakingError
from gibench.datasets.files import process_number
from gibench.datasets.folder import TOKEN
from gibench.datasets.pool import Listener, Work, explained

if TYPE_CHECKING:
    from distributed import Client, Future

#: Workers that a task may take with it: the third time it is set aside.
DEATHS = 3

#: Seconds between two looks at how many workers there are.
LOOK_SECONDS = 0.5

#: Seconds to wait for a word of the workers.
LISTEN_SECONDS = 0.02


def run_tasks(
    work: Work,
    tasks: Iterable[int],
    listener: Listener,
    *,
    cluster: str,
    root: Path,
    accepts: Callable[[Any], bool] | None = None,
) -> None:
    """Do every task on a cluster; returns when all are done or set aside. The counterpart of `pool.run_rooms`.

    cluster: "local:N", the address of a scheduler, or the path of a scheduler's file. root: a folder that every worker
    must see under the same path. The places of `work` name tasks on the dashboard too. A job that has a method `of`
    sends a worker what `of(number)` gives instead of itself. accepts: whether a worker may do tasks, by what the setup
    answered there; without it all must answer the same. A scheduler that is lost may come back within
    `opening.PATIENCE` seconds.

    Raises `ClusterError`: nobody listens, no workers, workers that are refused (with their address), no Dask; and
    `MakingError` as `pool.run_rooms` does.
    """
    left = deque(tasks)
    with _token(root) as token, opening.opened(cluster, len(left)) as place:
        lost = False
        while left:
            with opening.connected(place, lost=lost) as client:
                run = _Tasks(client, work, listener, token, accepts)
                run.prepare()
                left, lost = deque(run.do(left)), True


def facts_of_workers(setup: Callable[[], Any], *, cluster: str, root: Path) -> dict[str, tuple[str, Any]]:
    """Make all workers ready; by their address their host and what the setup answered. Raises ClusterError."""
    work = Work(setup, lambda number, report: None)
    listener = Listener(lambda facts: None, lambda *_: None, lambda *_: None, lambda number: None)
    with _token(root) as token, opening.connected(cluster) as client:
        run = _Tasks(client, work, listener, token, lambda facts: True)
        run.prepare()
        return {address: (run.hosts[address], facts) for address, facts in run.facts.items()}


@contextlib.contextmanager
def _token(root: Path) -> Iterator[Path]:
    """A file by which workers prove that they see a folder. When it goes, those that still do a task stop."""
    token = root / f"{TOKEN}{secrets.token_hex(8)}.partial-{process_number()}"
    token.write_text(token.name, encoding="utf-8")
    try:
        yield token
    finally:
        token.unlink(missing_ok=True)


class _Tasks:
    """Tasks handed to one scheduler for as long as it lives."""

    def __init__(
        self,
        client: Client,
        work: Work,
        listener: Listener,
        token: Path,
        accepts: Callable[[Any], bool] | None,
    ) -> None:
        self.client, self.work, self.listener, self.token = client, work, listener, token
        self.accepts = accepts
        # Not SimpleQueue: where a timeout has passed by the time that it looks again, it waits for ever (CPython 3.11).
        self.heard: queue.Queue[tuple[int, str, str, Any]] = queue.Queue()
        self.tries: dict[int, str] = {}
        self.begun: Counter[int] = Counter()
        self.hosts: dict[str, str] = {}
        self.facts: dict[str, Any] = {}
        self.readying: dict[str, Future] = {}
        self.waiting: dict[int, Future] = {}
        self.places: dict[int, str] = {}
        self.missed: set[str] = set()
        self.last_seen = time.monotonic()
        self.scheduler: str | None = None

    def prepare(self) -> None:
        """Make all workers that are there ready. Raises ClusterError with the address of one that cannot be used."""
        client = self.client
        try:
            client.wait_for_workers(1, timeout=opening.PATIENCE)
        except TimeoutError:
            raise ClusterError(
                f"the scheduler at {client.scheduler.address} has no workers: start some with "
                f"`dask worker {client.scheduler.address}`"
            ) from None
        for plugin in workers.one_renderer():
            client.register_plugin(plugin)
        client.subscribe_topic(self.token.name, lambda event: self.heard.put(event[1]))
        addresses = self._workers()
        answers = client.run(workers.examined, str(self.token), on_error="return")
        here = workers.versions()
        for address in addresses:
            opening.refuse_other(address, answers.get(address), here, self.token.parent)
            self.hosts[address] = answers[address]["host"]
        self._ready(addresses)
        while self.readying:
            time.sleep(0.05)
            self._take(self._workers())
        if not self.facts:
            raise ClusterError(
                "all workers died before they could render: `gibench doctor` on their machines says why"
            )

    def _ready(self, addresses: Iterable[str]) -> None:
        for address in addresses:
            self.readying[address] = self.client.submit(
                workers.made_ready,
                self.work.setup,
                key=f"renderer-{address}-{secrets.token_hex(4)}",
                workers=[address],
                resources={RENDERER: 1},
            )

    def _take(self, there: Iterable[str]) -> None:
        """What workers that were made ready have answered. Raises ClusterError with the address of one that cannot."""
        for address, future in list(self.readying.items()):
            if future.status in ("finished", "error"):
                del self.readying[address]
                try:
                    self.facts[address] = future.result()
                except Exception as problem:
                    raise ClusterError(
                        f"worker {address} cannot be used: {explained(problem, None)}"
                    ) from None
                self.listener.ready(self.facts[address])
            elif address not in there:
                del self.readying[address]

    def do(self, left: deque[int]) -> list[int]:
        """Returns the tasks that are still to be done when the scheduler is lost; none when all are done."""
        able: list[str] = []
        waiting, looked = self.waiting, 0.0
        try:
            while left or waiting:
                if time.monotonic() - looked > LOOK_SECONDS:
                    try:
                        able = self._able(left)
                    except (OSError, TimeoutError):
                        return [*waiting, *left]
                    looked = time.monotonic()
                # One a worker: a task that waits behind one that kills the worker would be suspected with it.
                busy = set(self.places.values())
                free = [address for address in able if address not in busy]
                for address in free[: len(left)]:
                    self._hand_out(left.popleft(), address)
                for number in self._listen():
                    if number in waiting:
                        self._taken_back(number).release()
                    elif number in left:  # done for the client that the scheduler lost before
                        left.remove(number)
                if self.client.status != "running":
                    return [*waiting, *left]
                for number in [number for number, future in waiting.items() if future.status != "pending"]:
                    if waiting[number].status in ("cancelled", "lost"):
                        return [*waiting, *left]
                    if waiting[number].status == "error" and self._is_to_be_tried(
                        number, self._taken_back(number)
                    ):
                        left.append(number)
            return []
        finally:
            if self.client.status == "running":
                with contextlib.suppress(OSError, TimeoutError):
                    self.client.cancel(list(waiting.values()), force=True)

    def _able(self, left: deque[int]) -> list[str]:
        """Addresses of the workers that may do tasks. Raises OSError or TimeoutError where the scheduler is gone."""
        there = self._workers()
        if there:
            self.last_seen = time.monotonic()
        elif time.monotonic() - self.last_seen > opening.ABANDONED:
            raise ClusterError(
                f"no worker has been there for {opening.ABANDONED:.0f} s: start some, then run the same command again "
                "to continue"
            )
        # Looked at twice: what a worker said last may be on its way when it is seen to be gone.
        gone = set(self.places.values()).difference(there)
        for number in [number for number, address in self.places.items() if address in gone & self.missed]:
            self.client.cancel([self._taken_back(number)], force=True)
            if self._has_lives(number):
                left.appendleft(number)
        self.missed = gone
        if self.accepts is None:
            return there
        self._ready(address for address in there if address not in {*self.facts, *self.readying})
        self._take(there)
        return [address for address in there if address in self.facts and self.accepts(self.facts[address])]

    def _taken_back(self, number: int) -> Future:
        """A task that is in nobody's hand any more."""
        del self.places[number]
        return self.waiting.pop(number)

    def _workers(self) -> list[str]:
        """Addresses of the workers. Raises OSError or TimeoutError where the scheduler is gone."""
        if self.client.status != "running":
            raise OSError("the scheduler is gone")
        limit = opening.PATIENCE / 4
        scheduler = self.client.sync(self.client.scheduler.identity, n_workers=0, callback_timeout=limit)[
            "id"
        ]
        if self.scheduler not in (None, scheduler):
            # The client found it by itself. It knows neither our tasks nor what its workers must bring.
            raise OSError("another scheduler has taken the place of ours")
        self.scheduler = scheduler
        return list(self.client.sync(self.client.scheduler.ncores, callback_timeout=limit))

    def _hand_out(self, number: int, address: str) -> None:
        job, name = self.work.job, self.work.place(number)
        self.places[number] = address
        self.waiting[number] = self.client.submit(
            workers.do_task,
            Work(self.work.setup, job.of(number) if hasattr(job, "of") else job),
            number,
            name,
            str(self.token),
            next(iter(self.facts.values())) if self.accepts is None else None,
            # The dashboard shows what comes before the first word that has a dash in front and a digit in it.
            key=f"{name.replace('-', ' ')}-{self.token.name[9:17]}{secrets.token_hex(2)}",
            workers=[address],
            resources={RENDERER: 1},
            priority=-number,
        )

    def _listen(self) -> list[int]:
        """Wait a little for what workers say and pass it on; returns the tasks that are done.

        A task counts as done when its worker says so: what it returns dies with the worker that holds it.
        """
        done = []
        with contextlib.suppress(queue.Empty):
            waited = LISTEN_SECONDS
            while True:
                number, attempt, kind, content = self.heard.get(timeout=waited)
                waited = 0.0
                if self.tries.get(number) == DONE:
                    continue
                if self.tries.get(number, attempt) != attempt:
                    self.listener.died(number)
                self.tries[number] = attempt
                if kind == DONE:
                    self.tries[number] = DONE
                    self.listener.done(number, content)
                    done.append(number)
                elif kind == BEGUN:
                    self.begun[number] += 1
                else:
                    self.listener.message(number, kind, content)
        return done

    def _is_to_be_tried(self, number: int, future: Future) -> bool:
        """Whether a task that has failed is tried again. Raises MakingError where nothing but itself is to blame."""
        from distributed import KilledWorker

        problem = future.exception()
        if isinstance(problem, workers.Elsewhere):
            self.begun[number] -= 1
            return True
        if not isinstance(problem, KilledWorker):
            text = (
                str(problem)
                if isinstance(problem, MakingError)
                else explained(problem, number, self.work.place)
            )
            raise MakingError(text) from None
        return self._has_lives(number)

    def _has_lives(self, number: int) -> bool:
        """Whether a task whose worker died is tried again; otherwise it is set aside."""
        self.listener.died(number)
        if self.begun[number] < DEATHS:
            return True
        self.tries[number] = DONE
        why = f"{self.begun[number]} workers that made it died; make it alone to see why"
        self.listener.done(number, {"rejected": why})
        return False
