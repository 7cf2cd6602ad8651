"""Turns on a machine that several workers share: many may prepare at the same time, but who measures does so alone."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from gibench.datasets.files import through_no_link


def turn_file() -> Path:
    """The file that holds the turns of this user on this machine."""
    user = os.getuid() if hasattr(os, "getuid") else "all"
    return Path(tempfile.gettempdir()) / f"gibench-turns-{user}"


@contextmanager
def beside(file: Path | None) -> Iterator[None]:
    """Work that others may do at the same time. file: of `turn_file`; None where nobody shares the machine."""
    with _held(file, alone=False, wait=lambda: None):
        yield


@contextmanager
def alone(file: Path | None, wait: Callable[[], None]) -> Iterator[None]:
    """A measurement, which begins when nobody works beside it. wait: called before waiting for that."""
    with _held(file, alone=True, wait=wait):
        yield


@contextmanager
def _held(file: Path | None, *, alone: bool, wait: Callable[[], None]) -> Iterator[None]:
    try:
        import fcntl
    except ImportError:  # Windows has no shared locks, and no several workers of a machine
        file = None
    if file is None:
        yield
        return
    wait()
    descriptor = through_no_link(str(file), os.O_RDWR | os.O_CREAT)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        yield
    finally:
        os.close(descriptor)  # which gives the turn back, as the end of the process would
