"""Schedulers and workers of Dask as people and batch systems start them: processes of their own."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil

ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}


def dask(*words: str) -> subprocess.Popen[bytes]:
    """A process of Dask in a group of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "dask", *words],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=ENVIRONMENT, start_new_session=True,
    )  # fmt: skip


def scheduler(file: Path, port: int = 0) -> subprocess.Popen[bytes]:
    file.unlink(missing_ok=True)
    words = ["--scheduler-file", str(file), "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
    process = dask("scheduler", *words)
    wait_until(file.exists)
    return process


def worker(
    file: Path, name: str, threads: int | None = None, *, nanny: bool = True
) -> subprocess.Popen[bytes]:
    """nanny: whether a process of its own starts it again when it dies."""
    words = ["--scheduler-file", str(file), "--name", name, "--no-dashboard", "--death-timeout", "300"]
    words += ["--nanny" if nanny else "--no-nanny"]
    return dask("worker", *words, "--nthreads", str(threads or os.cpu_count() or 1))


#: What stands for programs that a cluster has. What the job at last runs goes on until the job ends.
PROGRAMS = {
    "dask": """
        [ "$1" = scheduler ] && set -- "$@" --host 127.0.0.1
        exec {python} -m dask "$@" --no-dashboard
    """,
    "srun": """
        while [[ "$1" == -* ]]; do shift; done
        "$@" & "$@" & wait
    """,
    "pbsdsh": """
        [ "$1" = -- ] && shift
        "$@" & "$@" & wait
    """,
    "make-dataset": """
        printf '%s\n' "$@" > asked
        exec sleep 100000
    """,
}


def batch_job(system: str, folder: Path) -> subprocess.Popen[bytes]:
    """The batch job of the documentation as a batch system starts it, with two workers and this machine's threads.

    The words of its last command come to lie in `folder/asked`.
    """
    page = (Path(__file__).parents[1] / "docs" / "cluster.md").read_text(encoding="utf-8")
    section = page.partition(f"## {system}\n")[2]
    job = re.search(r"^```bash\n(.*?)^```$", section, re.M | re.S)[1]
    (folder / "job").write_text(re.sub(r"\b16\b", str(os.cpu_count() or 1), job), encoding="utf-8")
    programs = folder / "programs"
    programs.mkdir()
    for name, lines in PROGRAMS.items():
        (programs / name).write_text("#!/bin/bash\n" + lines.replace("{python}", sys.executable))
        (programs / name).chmod(0o755)
    given = {
        **dict.fromkeys(("SLURM_SUBMIT_DIR", "PBS_O_WORKDIR"), str(folder)),
        **dict.fromkeys(("SLURM_JOB_ID", "PBS_JOBID"), "17"),
        "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
    }
    return subprocess.Popen(
        ["bash", folder / "job"], env=ENVIRONMENT | given, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


@contextmanager
def two_workers(folder: Path) -> Iterator[Path]:
    """A scheduler's file, and two workers, started as the documentation's job for Slurm starts them."""
    job = batch_job("Slurm", folder)
    try:
        wait_until((folder / "asked").exists)
        yield folder / "scheduler-17.json"
    finally:
        killed(job)


@contextmanager
def no_patience_with_stopped_workers(address: str) -> Iterator[None]:
    """Within: a worker of this machine that is stopped has at once been silent for as long as its scheduler bears.

    Nobody waits for the limit, and none has to be so short that a worker of a busy machine is taken for a stopped one.
    """
    from distributed import Client

    over = threading.Event()

    def watch() -> None:
        with Client(address, set_as_default=False) as client:
            while not over.wait(0.2):
                client.run_on_scheduler(_forget_stopped_workers)

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def _forget_stopped_workers(dask_scheduler: Any) -> None:
    for one in dask_scheduler.workers.values():
        with contextlib.suppress(psutil.Error):
            if psutil.Process(one.pid).status() == psutil.STATUS_STOPPED:
                one.last_seen = time.time() - dask_scheduler.worker_ttl - 0.1


def idle(file: Path) -> bool:
    """Whether no worker of a scheduler is at a task."""
    from distributed import Client

    with Client(scheduler_file=str(file), set_as_default=False) as client:
        return not any(client.run(lambda dask_worker: len(dask_worker.state.executing)).values())


def wait_until(condition, seconds: float = 120) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.05)


def killed(*processes: subprocess.Popen[bytes]) -> None:
    for process in processes:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
