"""Schedulers and workers of Dask as people and batch systems start them: processes of their own."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

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


def worker(file: Path, name: str, threads: int | None = None) -> subprocess.Popen[bytes]:
    words = ["--scheduler-file", str(file), "--name", name, "--no-dashboard", "--death-timeout", "300"]
    return dask("worker", *words, "--nthreads", str(threads or os.cpu_count() or 1))


@contextmanager
def two_workers(folder: Path) -> Iterator[Path]:
    """A scheduler's file, and two workers that were started by hand, as the jobs of a batch system are."""
    file = folder / "scheduler.json"
    processes = [scheduler(file)]
    try:
        processes += [worker(file, name) for name in ("one", "two")]
        yield file
    finally:
        killed(*processes)


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
