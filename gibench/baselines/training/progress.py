"""Progress of a training: a bar on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

QUIET_SECONDS = 30.0
"""Between two lines where there is no terminal."""


@dataclass(frozen=True)
class Standing:
    """step of steps (None: not planned yet). share: of the training that is over, in [0, 1]. left: seconds, None while
    nobody can know. loss: the one to watch. error: the best held-out one. over: whether this is the end.
    """

    step: int
    steps: int | None
    share: float
    left: float | None
    loss: float
    error: float
    over: bool = False

    @property
    def steps_text(self) -> str:
        """As in "12/400"."""
        return f"{self.step}/{self.steps or '?'}"

    @property
    def left_text(self) -> str:
        """Hours, minutes and seconds."""
        if self.left is None:
            return "-:--:--"
        seconds = round(self.left)
        return f"{seconds // 3600}:{seconds // 60 % 60:02}:{seconds % 60:02}"


Tell = Callable[[Standing], None]


@contextmanager
def telling(title: str) -> Iterator[Tell]:
    """Something to tell the standing of a training to, on standard error."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield _lines(console, title)
        return
    bar = Progress(
        TextColumn("{task.description} {task.fields[steps]}"),
        BarColumn(bar_width=None),
        TextColumn("{task.fields[state]}"),
        TextColumn("{task.fields[left]}", style="progress.remaining"),
        console=console,
        transient=True,
    )
    with bar:
        task = bar.add_task(title, total=1.0, steps="", state="", left="")

        def show(now: Standing) -> None:
            state = f"loss {now.loss:.4g} held out {now.error:.4g}"
            bar.update(task, completed=now.share, steps=now.steps_text, state=state, left=now.left_text)

        yield show


def _lines(console: Console, title: str) -> Tell:
    said = time.monotonic()

    def say(now: Standing) -> None:
        nonlocal said
        if time.monotonic() - said >= QUIET_SECONDS or now.over:
            said = time.monotonic()
            text = f"{title}: step {now.steps_text}, loss {now.loss:.4g}, held out {now.error:.4g}"
            console.print(
                text if now.over else f"{text}, {now.left_text} left", soft_wrap=True, highlight=False
            )

    return say
