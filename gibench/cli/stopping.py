"""Signals that stop a command: SIGTERM and SIGHUP end it as tidily as Ctrl-C does.

Containers, batch systems and service managers send SIGTERM, a terminal that is closed sends SIGHUP.
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from typing import Any

SIGNALS = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))


@contextlib.contextmanager
def stoppable() -> Iterator[list[int]]:
    """Raise KeyboardInterrupt at the first signal to end; later ones do not disturb the tidying.

    A signal that is ignored, as `nohup` has SIGHUP, stays so. Gives a list that the number of the signal is put into.
    """
    before: dict[int, Any] = {}
    received: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield received
        return

    def stop(number: int, _: Any) -> None:
        for other in before:
            signal.signal(other, signal.SIG_IGN)
        received.append(number)
        raise KeyboardInterrupt

    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            before[number] = signal.signal(number, stop)
    try:
        yield received
    finally:
        for number, answer in before.items():
            signal.signal(number, answer)
