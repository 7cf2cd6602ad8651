"""Times of functions that are compared with each other."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable


def seconds(
    *functions: Callable[[], object], repeats: int = 7, clock: Callable[[], float] = time.perf_counter
) -> list[float]:
    """Median seconds of each function, run in turn so that a busy machine slows all of them alike.

    Each is run once before, which compiles, loads and fills caches. clock: of seconds, such as `time.process_time`.
    """
    for function in functions:
        function()
    times: list[list[float]] = [[] for _ in functions]
    for _ in range(repeats):
        for function, taken in zip(functions, times, strict=True):
            start = clock()
            function()
            taken.append(clock() - start)
    return [statistics.median(taken) for taken in times]
