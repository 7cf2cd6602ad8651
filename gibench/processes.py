"""Processes that are watched: spawned afresh, heard through a pipe, gone with whoever started them.

What crashes, hangs or grows in one costs that one alone. Workers of datasets, results and trainings of the benchmark,
hard cases and looks at a machine run in them; each says what its messages mean, and what follows from its end.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable
from multiprocessing.connection import Connection, wait
from typing import Any, Self

from gibench.errors import GibenchError

#: Most seconds between two calls of what is to be done while waiting for a message.
LOOK_SECONDS = 1.0


class ProcessEnded(GibenchError):
    """A process has ended and tells nothing more.

    code: its exit code, negative for the number of a signal. how: in words, "killed by SIGKILL" or "ended with code 3".
    """

    def __init__(self, code: int) -> None:
        """code: as `multiprocessing` gives it."""
        self.code = code
        self.how = f"killed by {_signal_name(-code)}" if code < 0 else f"ended with code {code}"
        super().__init__(f"its process was {self.how}" if code < 0 else f"its process {self.how}")


class TookTooLong(GibenchError):
    """A process has told nothing for as long as it was given."""


class ChildProcess:
    """A process and the pipe by which it tells of its work. As a context it is gone when that is left.

    connection: our end, to send by and to `multiprocessing.connection.wait` for.
    """

    def __init__(self, body: Callable[..., None], *arguments: Any) -> None:
        """Start it. body: a function of a module; it gets its end of the pipe, then the arguments, all pickled."""
        context = multiprocessing.get_context("spawn")
        self.connection: Connection
        self.connection, theirs = context.Pipe()
        self._process = context.Process(target=_run, args=(body, theirs, arguments), daemon=True)
        self._process.start()
        theirs.close()

    @property
    def pid(self) -> int:
        """Its number."""
        return self._process.pid or 0

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self._process.is_alive()

    def receive(self, seconds: float = math.inf, waiting: Callable[[], None] = lambda: None) -> Any:
        """Return its next message.

        seconds: to wait for it. waiting: called every `LOOK_SECONDS` until it comes. Raises ProcessEnded, TookTooLong.
        """
        end = time.monotonic() + seconds
        while not self.connection.poll(max(0.0, min(LOOK_SECONDS, end - time.monotonic()))):
            waiting()
            if time.monotonic() >= end:
                raise TookTooLong(f"it took more than {seconds:g} s")
        try:
            return self.connection.recv()
        except (EOFError, OSError):
            self._process.join()
            raise ProcessEnded(self._process.exitcode or 0) from None

    def end(self) -> None:
        """Wait until it has ended by itself: its end of the pipe tells it that nothing more comes."""
        self.connection.close()
        self._process.join()

    def kill(self) -> None:
        """End it, however far it is. Twice does no harm."""
        self._process.kill()

    def close(self) -> None:
        """End it, and wait until it is gone."""
        self.kill()
        self.end()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _run(body: Callable[..., None], connection: Connection, arguments: tuple[Any, ...]) -> None:
    """Body of every such process."""
    _leave_signals_to_parent()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    body(connection, *arguments)


def _leave_signals_to_parent() -> None:
    """Ignore what asks to end: it reaches a whole group, and the process that spawned this one decides."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)


def _end_with_parent() -> None:
    """Body of a thread that ends this process when the one that spawned it ends, however it does."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # one of real time has none
        return f"signal {number}"
