"""The folder of a dataset while it is being made: who may write to it, what in it is whole."""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from gibench import gate
from gibench.datasets.errors import FolderError
from gibench.datasets.unfinished import keep_frames

MANIFEST = "dataset.json"
TABLE = "frames.parquet"
PREVIEW = "preview.png"
RECORD = "frames.json"
LOCK = ".lock"
ENVIRONMENTS = "environments"
CACHE = "cache"
CARD = "DATASET.md"

#: Beginning of the name of a file by which workers of a cluster prove that they see a folder.
TOKEN = ".cluster-"


def room_folder(root: Path, room: int) -> Path:
    """Folder of a whole room."""
    return root / "rooms" / f"{room:06d}"


def partial_folder(root: Path, room: int, owner: int) -> Path:
    """Folder in which process number `owner` builds a room until it is whole."""
    return root / "rooms" / f".{room:06d}.partial-{owner}"


def whole_rooms(root: Path) -> list[int]:
    """Numbers of the rooms that are whole, ascending. A room folder gets its name only when it is."""
    rooms = root / "rooms"
    names = [entry.name for entry in rooms.iterdir()] if rooms.is_dir() else []
    return sorted(
        int(name) for name in names if re.fullmatch("[0-9]{6,9}", name) and (rooms / name / RECORD).is_file()
    )


def remove_partials(root: Path, room: int | None = None) -> None:
    """Remove what killed processes left of a room, or of all rooms. Only for the holder of the lock.

    Nothing goes but what carries such a process's own names, and nothing behind a link; frames that took a while
    wait for the next run.
    """
    stem = "[0-9]{6,}" if room is None else f"{room:06d}"
    for left in gate.own_leftovers(root / "rooms", rf"\.{stem}\.partial-[0-9]+"):
        if gate.real_folder(left):
            keep_frames(root, int(left.name[1:].partition(".")[0]), left)
    if room is None:
        for left in gate.own_leftovers(root / ENVIRONMENTS, r"\.[0-9a-f]{64}\.exr\.partial-[0-9]+"):
            left.unlink(missing_ok=True)
        remove_tokens(root)
        names = "|".join(map(re.escape, (MANIFEST, TABLE, PREVIEW, CARD)))
        for left in gate.own_leftovers(root.resolve(), rf"\.({names})\.partial-[0-9]+"):
            if not gate.real_folder(left):
                left.unlink(missing_ok=True)


def remove_tokens(root: Path) -> None:
    """Remove what killed runs on clusters left, so that workers which still do their tasks stop."""
    for left in gate.own_leftovers(root.resolve(), rf"{re.escape(TOKEN)}[0-9a-f]{{16}}\.partial-[0-9]+"):
        if not gate.real_folder(left):
            left.unlink(missing_ok=True)


def remove_empty_dataset(root: Path) -> None:
    """Remove what a dataset without any whole room consists of. Only for the holder of the lock."""
    for name in (MANIFEST, TABLE, PREVIEW, CARD):
        (root / name).unlink(missing_ok=True)
    for panorama in gate.own_leftovers(root / ENVIRONMENTS, r"[0-9a-f]{64}\.exr"):
        panorama.unlink()
    remove_empty([root / ENVIRONMENTS, root / "rooms"])


@contextmanager
def claimed(root: Path) -> Iterator[None]:
    """Hold the folder of a dataset for one run alone, and make it where it does not exist.

    On the way out the lock goes, and so do the folders that were made here if nothing was put into them.
    Raises `FolderError`: it is a file, cannot be written, holds something that is no dataset, or is in use.
    """
    made: list[Path] = []
    try:
        made = [folder for folder in (root, *root.parents) if not folder.exists()]
        root.mkdir(parents=True, exist_ok=True)
        refuse_links(root, [root / "rooms", root / ENVIRONMENTS, root / CACHE])
        if not (root / MANIFEST).exists():
            _refuse_foreign(root)
        lock = lock_folder(root)
    except OSError as problem:
        remove_empty(made)
        raise FolderError(_why_not(root, problem)) from None
    try:
        remove_partials(root)
        yield
    finally:
        remove_partials(root)
        unlock_folder(root, lock)
        remove_empty(made)


def _refuse_foreign(root: Path) -> None:
    # `rooms` without a manifest is not ours: the manifest is written before the first room.
    foreign = sorted(
        entry.name for entry in root.iterdir() if not entry.name.startswith((LOCK, f".{MANIFEST}.", TOKEN))
    )
    if foreign:
        raise FolderError(
            f"{root} holds files but no dataset ({foreign[0]} …): choose an empty or a new folder with --out"
        )


def refuse_links(root: Path, folders: Iterable[Path]) -> None:
    """Raise `FolderError` where one of the folders that a run writes to and deletes from is a link or a file."""
    for folder in folders:
        if gate.taken(folder):
            raise FolderError(
                f"{folder} is no folder of {root} itself but a link or a file: nothing is written or removed "
                "through it; put a real folder in its place, or choose another with --out"
            )


def _why_not(root: Path, problem: OSError) -> str:
    if isinstance(problem, FileExistsError | NotADirectoryError):
        return f"{root} is no folder, or lies under a file: choose another with --out"
    if problem.errno == errno.ENOSPC:
        return f"no space is left for {root}: free some, or choose another disk with --out"
    return f"{_short(root)} cannot be written ({problem.strerror}): choose another folder with --out"


def _short(root: Path) -> str:
    text = str(root)
    return text if len(text) <= 200 else f"{text[:200]}…"


def lock_folder(root: Path) -> FileLock:
    """The lock of a folder, held by this process until `unlock_folder` or its end, however it ends.

    Raises `FolderError` where another process holds it, or where its file is a link or no file.
    """
    path = root / LOCK
    lock = FileLock(path, timeout=0, mode=0o644)
    # A link would have the lock made, or held, somewhere else.
    no_file = FolderError(f"{path} is a link or no file: remove it, or choose another folder with --out")
    if path.is_symlink() or (path.exists() and not path.is_file()):
        raise no_file
    try:
        lock.acquire()
    except Timeout:
        raise FolderError(
            f"{root} is in use by another run: wait for it, or write elsewhere with --out"
        ) from None
    except OSError as problem:
        if problem.errno in (errno.ELOOP, errno.EMLINK, errno.EISDIR, errno.ENXIO):
            raise no_file from None
        raise
    return lock


def unlock_folder(root: Path, lock: FileLock) -> None:
    """Give back what `lock_folder` took, and its file: who waits for it finds that it is gone and makes it anew."""
    if os.name == "posix":  # elsewhere releasing removes it, and an open file cannot be removed
        (root / LOCK).unlink(missing_ok=True)
    lock.release()


def remove_empty(folders: Iterable[Path]) -> None:
    """Remove folders, one inside the next, as far as they are empty."""
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()
