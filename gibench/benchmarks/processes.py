"""Worker processes, as the process that starts them sees them."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from gibench.benchmarks import worker

#: Seconds that a process which takes too long is given to say where it is.
TRACEBACK_SECONDS = 1.0

#: Seconds between two looks at whether what a process does is still wanted.
LOOK_SECONDS = 1.0


class Unwanted(Exception):
    """Whoever asked for the results of a process is gone."""


class Process:
    """A worker process, gone when the context is left."""

    def __init__(self, task: worker.Task, wanted: Callable[[], bool] = lambda: True) -> None:
        """It starts when the context is entered. wanted: asked every second."""
        self.task, self.wanted = task, wanted

    def __enter__(self) -> Process:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        self.connection: Connection = ours
        self.process = context.Process(target=worker.work, args=(theirs, self.task), daemon=True)
        self.process.start()
        theirs.close()
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.join()
        self.connection.close()

    def receive(self, limit: float) -> tuple[str, Any]:
        """The next message; ("lost", reason and traceback) where the process dies or takes over `limit` seconds.

        Raises Unwanted.
        """
        end = time.monotonic() + limit
        while not self.connection.poll(max(0.0, min(LOOK_SECONDS, end - time.monotonic()))):
            if not self.wanted():
                raise Unwanted
            if time.monotonic() < end:
                continue
            with suppress(OSError):
                os.kill(self.process.pid or 0, signal.SIGUSR1)
            time.sleep(TRACEBACK_SECONDS)
            reason = f"it took more than {limit:g} s, the track's limit"
            return "lost", {"reason": reason, "traceback": log_tail(self.task.log)}
        try:
            return tuple(self.connection.recv())
        except (EOFError, OSError):
            self.process.join()
            code = self.process.exitcode or 0
            how = f"killed by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
            hint = " (out of memory?)" if code == -signal.SIGKILL else ""
            reason = f"its process was {how}{hint}" if code < 0 else f"its process {how}"
            return "lost", {"reason": reason, "traceback": log_tail(self.task.log)}


def log_tail(log: Path, characters: int = 4000) -> str:
    """The end of what a process wrote to the terminal."""
    with suppress(OSError):
        return log.read_text(encoding="utf-8", errors="replace")[-characters:]
    return ""
