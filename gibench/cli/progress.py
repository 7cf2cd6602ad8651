"""Progress on the terminal: a bar where there is one, a plain line now and then where there is none."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

if TYPE_CHECKING:
    from gibench.datasets.making import Progress as Making

#: Seconds between two lines where the output is no terminal.
QUIET_SECONDS = 30.0


def duration(seconds: float) -> str:
    """Return seconds as people read them: "4.2 s", "12 min", "3 h 05 min"."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"


def amount(number: float, unit: str) -> str:
    """Return a number with a decimal prefix: "1.3 MB", "850 kB"."""
    for factor, prefix in ((1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k")):
        if abs(number) >= factor:
            return f"{number / factor:.3g} {prefix}{unit}"
    return f"{number:.3g} {unit}"


@contextmanager
def making() -> Iterator[Callable[[Making], None]]:
    """Show how far the making of a dataset is: rooms, frames, paths a second, time left. Fits 80 columns."""
    console = Console(stderr=True)
    started = time.monotonic()
    if not console.is_terminal:
        said = started

        def tell(now: Making) -> None:
            nonlocal said
            _remark(console, now)
            if time.monotonic() - said >= QUIET_SECONDS:
                said = time.monotonic()
                console.print(
                    f"{_counts(now)}, {_speed(now, started)}, {_left(now, started)}", soft_wrap=True
                )

        yield tell
        return
    bar = Progress(
        TextColumn("{task.fields[counts]}"),
        BarColumn(bar_width=None),
        TextColumn("{task.fields[speed]}"),
        TimeRemainingColumn(compact=True),
        console=console,
        transient=True,
        expand=True,
    )
    with bar:
        task = bar.add_task("", total=None, counts="starting", speed="")

        def show(now: Making) -> None:
            _remark(console, now)
            bar.update(
                task,
                total=now.frames,
                completed=now.frames_done,
                counts=_counts(now),
                speed=_speed(now, started),
            )

        yield show


def _remark(console: Console, now: Making) -> None:
    """Print what has not been printed yet."""
    while now.remarks:
        console.print(now.remarks.pop(0), soft_wrap=True, markup=False, highlight=False)


def _counts(now: Making) -> str:
    return f"rooms {now.rooms_done}/{now.rooms} frames {now.frames_done}/{now.frames}"


def _speed(now: Making, started: float) -> str:
    return (
        f"{amount(now.paths / max(time.monotonic() - started, 1e-3), 'paths/s')}" if now.paths else "starting"
    )


def _left(now: Making, started: float) -> str:
    made = now.frames_done - now.frames_before
    if made <= 0:
        return "time left unknown"
    return f"{duration((time.monotonic() - started) / made * (now.frames - now.frames_done))} left"


@contextmanager
def counting(what: str) -> Iterator[Callable[[int, int], None]]:
    """Show "done of all" of something, on a terminal only."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda done, of: None
        return
    bar = Progress(
        TextColumn(what + " {task.completed}/{task.total}"), BarColumn(), console=console, transient=True
    )
    with bar:
        task = bar.add_task(what, total=None)
        yield lambda done, of: bar.update(task, completed=done, total=of)
