"""Worker processes, as the process that starts them sees them."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from gibench.benchmarks import worker
from gibench.processes import ChildProcess, ProcessEnded, TookTooLong

#: Seconds that a process which takes too long is given to say where it is.
TRACEBACK_SECONDS = 1.0


class Unwanted(Exception):
    """Whoever asked for the results of a process is gone."""


class Process(ChildProcess):
    """A worker process."""

    def __init__(self, task: worker.Task, wanted: Callable[[], bool] = lambda: True) -> None:
        """Start it. wanted: asked every second."""
        super().__init__(worker.work, task)
        self.log, self.wanted = task.log, wanted

    def message(self, limit: float) -> tuple[str, Any]:
        """The next message; ("lost", reason and traceback) where the process dies or takes over `limit` seconds.

        Raises Unwanted.
        """
        try:
            return tuple(self.receive(limit, self._refuse_unwanted))
        except TookTooLong as late:
            with suppress(OSError):
                os.kill(self.pid, signal.SIGUSR1)
            time.sleep(TRACEBACK_SECONDS)
            reason = f"{late}, the track's limit"
        except ProcessEnded as end:
            reason = str(end) + " (out of memory?)" * (end.code == -signal.SIGKILL)
        return "lost", {"reason": reason, "traceback": log_tail(self.log)}

    def _refuse_unwanted(self) -> None:
        if not self.wanted():
            raise Unwanted


def log_tail(log: Path, characters: int = 4000) -> str:
    """The end of what a process wrote to the terminal."""
    with suppress(OSError):
        return log.read_text(encoding="utf-8", errors="replace")[-characters:]
    return ""
