"""The gate that every path goes through which a file of somebody else names, and every folder that we delete from.

A dataset, a folder of results or a scene may come from anywhere. What its files name is read only where it is a regular
file below the folder itself, links resolved: no device, no pipe, nothing of the reader's own. Folders that gibench
writes to or deletes from are real folders, never links.
"""

from __future__ import annotations

import errno
import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path

from gibench.errors import GibenchError

#: Most bytes of a file of text that is read whole: a record, a manifest, scores. The largest that gibench writes, for a
#: room of ten thousand frames, is a tenth of it.
LARGEST_TEXT = 64 * 2**20

#: Most bytes of a name that becomes part of a file's name, which systems cut at 255.
LONGEST_NAME = 120


class GateError(GibenchError):
    """A path that must not be followed, or that nothing readable lies at.

    missing: nothing lies there.
    """

    def __init__(self, message: str, *, missing: bool = False) -> None:
        """message: the path, and what is wrong with it."""
        super().__init__(message)
        self.missing = missing


def inside(root: Path, name: str | os.PathLike[str]) -> Path:
    """Return `root / name` where that is a regular file below `root`, links resolved. Raises `GateError`."""
    base, text = os.fspath(root), os.fspath(name)
    try:
        if not text or os.path.isabs(text):
            raise GateError(f"{text!r} is no file of {base}: a name in it counts from there")
        folder = os.path.realpath(base, strict=True)
        path = os.path.realpath(os.path.join(folder, text), strict=True)
        if os.path.commonpath((folder, path)) != folder:
            raise GateError(f"{text!r} leads out of {base}: only files in the folder itself are read")
        mode = os.stat(path).st_mode
    except OSError as problem:
        raise GateError(
            f"{text!r} of {base} cannot be read: {problem.strerror}",
            missing=problem.errno in (errno.ENOENT, errno.ENOTDIR),
        ) from None
    except ValueError:  # a null character
        raise GateError(f"{text!r} is no name of a file") from None
    if not stat.S_ISREG(mode):
        raise GateError(f"{text!r} of {base} is no regular file")
    return Path(base) / text


def read_inside(root: Path, name: str | os.PathLike[str], limit: int = LARGEST_TEXT) -> bytes:
    """Read a regular file below `root` of at most `limit` bytes, links resolved. Raises `GateError`."""
    return read_regular(inside(root, name), limit)


def read_regular(path: Path, limit: int = LARGEST_TEXT) -> bytes:
    """Read a file that is regular and holds at most `limit` bytes; never waits at a pipe. Raises `GateError`."""
    with opened(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size > limit:
            raise GateError(f"{path} holds {size} bytes, more than the {limit} that are read")
        return file.read(limit)


@contextmanager
def opened(path: Path) -> Iterator[BufferedReader]:
    """Open a regular file for reading; never waits at a pipe. Raises `GateError`, also while it is read."""
    try:
        # A pipe without a writer would be waited for.
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        with open(descriptor, "rb") as file:
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                raise GateError(f"{path} is no regular file")
            yield file
    except OSError as problem:
        raise GateError(
            f"{path} cannot be read: {problem.strerror}",
            missing=problem.errno in (errno.ENOENT, errno.ENOTDIR),
        ) from None


def real_folder(path: Path) -> bool:
    """Whether a folder lies there that is no link: one that may be written to and deleted from."""
    try:
        return stat.S_ISDIR(os.lstat(path).st_mode)
    except (OSError, ValueError):
        return False


def own_leftovers(folder: Path, pattern: str) -> list[Path]:
    """Paths in a folder whose names match a pattern; none where the folder is a link."""
    if not real_folder(folder):
        return []
    return [entry for entry in folder.iterdir() if re.fullmatch(pattern, entry.name)]


def taken(path: Path) -> bool:
    """Whether anything lies there that is no real folder: a link, even one that leads nowhere, or a file."""
    return os.path.lexists(path) and not real_folder(path)


def is_name(text: object) -> bool:
    """Whether a text may become part of a file's name: a letter or digit, then also ``_ . + : @ = -``; no separator."""
    return (
        isinstance(text, str)
        and re.fullmatch(r"\w[\w.+:@=-]*", text) is not None
        and len(text.encode(errors="replace")) <= LONGEST_NAME
    )
