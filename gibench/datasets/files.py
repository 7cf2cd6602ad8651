"""Files that appear under their name only when they are whole."""

from __future__ import annotations

import json
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any


def process_number() -> int:
    """A number of this process that no other has: machines that share a folder repeat the numbers of processes."""
    return _number(os.getpid())


@cache
def _number(process: int) -> int:
    return int(f"{secrets.randbelow(10**9) + 1}{process:07d}")


def write_whole(path: Path, content: bytes) -> None:
    """Write beside, sync, rename: after a crash at any instant `path` is the old file or the new one.

    Raises OSError; nothing is left behind then.
    """
    beside = path.with_name(f".{path.name}.partial-{process_number()}")
    try:
        with open(beside, "wb", opener=through_no_link) as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, path)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """A folder beside `path` to write into, which takes its name at the end: it appears whole or not at all.

    path: where nothing lies yet, or an empty folder. Raises OSError; nothing is left behind then.
    """
    beside = path.with_name(f".{path.name}.partial-{process_number()}")
    try:
        beside.mkdir(parents=True)
        yield beside
        sync_tree(beside)
        if path.is_dir():
            path.rmdir()
        beside.rename(path)
        sync_folder(path.parent)
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def through_no_link(path: str, flags: int) -> int:
    """Open a file as `open` does, but raise OSError where a link lies under its name: for what is written."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0), 0o666)


def as_json(value: Any) -> bytes:
    """Indented JSON that ends with a line break. Raises ValueError for numbers that are not finite."""
    return (json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()


def sync_file(path: Path) -> None:
    """Make sure that the content of a file that is already closed has reached the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def sync_folder(folder: Path) -> None:
    """Make sure that the names in a folder have reached the disk, where the system has such a call."""
    if hasattr(os, "O_DIRECTORY"):
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def sync_tree(folder: Path) -> None:
    """Make sure that everything below a folder has reached the disk."""
    for where, _, names in os.walk(folder):
        for name in names:
            sync_file(Path(where) / name)
        sync_folder(Path(where))
