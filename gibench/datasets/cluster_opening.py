"""Finding a cluster: one of this machine, or the scheduler that somebody has started."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gibench import gate
from gibench.datasets.cluster_workers import DECIDING
from gibench.datasets.errors import ClusterError
from gibench.datasets.pool import MOST_WORKERS

if TYPE_CHECKING:
    from distributed import Client, Scheduler

#: Seconds that a scheduler and its first worker may take to answer, and a scheduler that was lost to come back.
PATIENCE = 60.0

#: Seconds that a scheduler may take to write its file.
WRITING = 2.0

#: Seconds without any worker after which a run ends: those that were there have given up, or their jobs have ended.
ABANDONED = 600.0

#: Seconds without a sign of life after which a worker of a local cluster is given up.
SILENCE = 60.0


@contextlib.contextmanager
def opened(cluster: str, tasks: int = MOST_WORKERS) -> Iterator[str]:
    """The address or file of a scheduler; "local:N" starts one with N workers, at most as many as there are tasks.

    What was started ends with the context. Raises ClusterError: no Dask, no such file, no such number.
    """
    dask, distributed = _libraries()
    name, _, number = cluster.partition(":")
    if name == "local":
        if not (number.isascii() and number.isdigit() and 1 <= int(number) <= MOST_WORKERS):
            raise ClusterError(
                f"--cluster: '{cluster}' is not allowed; write local:N with N from 1 to {MOST_WORKERS}"
            )
        settings = {
            "distributed.scheduler.worker-ttl": f"{SILENCE:.0f} s",
            "distributed.comm.timeouts.connect": f"{PATIENCE:.0f} s",
        }
        with (
            dask.config.set(settings),
            distributed.LocalCluster(
                n_workers=min(int(number), max(tasks, 1)),
                threads_per_worker=max(1, (os.cpu_count() or 1) // int(number)),
                processes=True,
                dashboard_address=":0",
                scheduler_kwargs={"dashboard": False},  # nobody is told its address
                silence_logs=logging.CRITICAL,
            ) as there,
        ):
            there.sync(_look_every_second, there.scheduler)
            yield there.scheduler_address
        return
    if cluster.endswith(".json") and not Path(cluster).is_file():
        raise ClusterError(f"--cluster: there is no scheduler file {cluster}: `dask scheduler` writes one")
    yield cluster


async def _look_every_second(scheduler: Scheduler) -> None:
    """For workers that are silent. Dask looks as often as they may be: one could be so for twice as long."""
    look = scheduler.periodic_callbacks["worker-ttl"]
    look.stop()
    look.callback_time = 1000.0
    look.start()


@contextlib.contextmanager
def connected(cluster: str, *, lost: bool = False) -> Iterator[Client]:
    """A client of the scheduler at an address, or of a scheduler's file. lost: whether it was there before."""
    _, distributed = _libraries()
    gone = ClusterError(
        f"the scheduler at {cluster} is gone: start it again, then run the same command again to continue"
    )
    address = cluster
    if cluster.endswith(".json"):
        # Dask's client would wait for ever for a file that is not there: a scheduler that ends takes its own away.
        try:
            address = _address_in(Path(cluster), PATIENCE if lost else WRITING)
        except ClusterError:
            if lost:
                raise gone from None
            raise
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as problem:
        if lost:
            raise gone from None
        raise ClusterError(
            f"--cluster: nobody answers at {cluster} ({' '.join(str(problem).split())[:200]}): start a scheduler "
            "with `dask scheduler`, or write local:N"
        ) from None
    try:
        yield client
    finally:
        client.close(timeout=2)


def _address_in(file: Path, patience: float) -> str:
    """Of the scheduler that has written a file. Raises ClusterError where none has after `patience` seconds."""
    end = time.monotonic() + patience
    while True:
        try:
            return str(json.loads(gate.read_regular(file))["address"])
        except (gate.GateError, ValueError, LookupError, TypeError):
            if time.monotonic() > end:
                break
        time.sleep(0.1)
    raise ClusterError(f"--cluster: {file} is not what `dask scheduler --scheduler-file` writes")


def _libraries() -> tuple[Any, Any]:
    try:
        import dask
        import distributed
    except ImportError:
        raise ClusterError("--cluster needs Dask: pip install 'gibench[cluster]'") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    return dask, distributed


def refuse_other(address: str, answer: Any, here: dict[str, str], folder: Path) -> None:
    """Raise ClusterError for a worker that cannot be used. answer: of `examined`; here: versions of this process."""
    if not isinstance(answer, dict):
        reason = " ".join(str(answer).split()) or "no answer"
        raise ClusterError(
            f"worker {address} cannot be used: {reason}; it needs this gibench: pip install gibench"
        )
    if not answer["sees"]:
        raise ClusterError(
            f"worker {address} on {answer['host']} does not see the folder {folder}: every worker needs it under the "
            "same path, on a disk that all share"
        )
    there = answer["versions"]
    if differing := [name for name in DECIDING if there.get(name) != here.get(name)]:
        listed = "; ".join(f"{n}: {there.get(n)} there, {here.get(n)} here" for n in differing)
        raise ClusterError(
            f"worker {address} on {answer['host']} would make other pixels ({listed}): pip install the same"
        )
