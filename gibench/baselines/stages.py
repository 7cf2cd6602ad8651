"""Wall time of the parts of a preparation or of a frame, with the device synchronised at every boundary."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager


def synchronise() -> None:
    """Wait until the device has done all it was asked; only libraries that are loaded are asked."""
    if drjit := sys.modules.get("drjit"):
        drjit.sync_thread()
    torch = sys.modules.get("torch")
    if torch is not None and torch.cuda.is_available() and torch.cuda.is_initialized():
        torch.cuda.synchronize()


class Stages:
    """Seconds by stage. Stages do not nest: time counts once.

    A kernel runs where its result is evaluated, so evaluate (`dr.eval`) before a stage ends, or its time is found in
    a later one.
    """

    def __init__(self) -> None:
        """Start with nothing."""
        self.seconds: dict[str, float] = {}
        self._current: str | None = None

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add what happens inside to stage `name`, an exception's share too."""
        if self._current is not None:
            raise RuntimeError(f"stage {name} begins inside stage {self._current}")
        synchronise()
        self._current = name
        start = time.perf_counter()
        try:
            yield
            synchronise()
        finally:
            self._current = None
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
