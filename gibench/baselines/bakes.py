"""Baked files, kept by what they depend on and shared by all methods that ask for the same.

They depend on the sources of their making too: code that is edited bakes anew. What a bake cost is kept with it, so
that a method is charged for a lightmap that another one made first.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gibench import gate
from gibench.baselines.sources import digest, module_of
from gibench.baselines.stages import synchronise
from gibench.baselines.training_set import TrainingSet
from gibench.datasets.checked import Amount, Checked, Count, parsed
from gibench.datasets.files import as_json, process_number, sync_tree

RECORD = "bake.json"

NAME = r"\.[^/]+-[0-9a-f]{24}"
"""Pattern of the name of what lies beside a bake while it is made."""

PARTIAL = ".partial-"
"""Between the name of a half-made bake and the number of the process that makes it."""


@dataclass(frozen=True)
class Bake:
    """A folder of baked files.

    seconds: that making them took, whoever did. size: in bytes on disk. before: seconds among them that runs spent
    that were cut off, where this process made the rest.
    """

    kind: str
    folder: Path
    seconds: float
    size: int
    before: float = 0.0


class BakeCache:
    """Bakes of one scene below one folder.

    scene: what identifies the scene, its content included (a SHA-256). machine: what else a bake's time and bits
    depend on: variant, versions, hardware.
    """

    def __init__(
        self, root: Path, scene: str, machine: Mapping[str, Any], views: TrainingSet | None = None
    ) -> None:
        """root: made when something is baked. What killed processes left there goes.

        views: what a making may learn from. Those that it is handed are kept with the bake, and charged to whoever
        finds it.
        """
        self.root, self._scene, self._machine = root, scene, dict(machine)
        self._views = TrainingSet() if views is None else views
        self.used: list[Bake] = []
        self.made: list[Bake] = []
        remove_abandoned(root)

    def get(
        self,
        kind: str,
        settings: Mapping[str, Any],
        make: Callable[[Path], float | None],
        *,
        using: Sequence[Callable[..., Any]] = (),
    ) -> Bake:
        """The bake of these settings, made by `make(folder)` where it is not there yet.

        kind: "lightmap", "probes" …, what its time is booked under. settings: all that decides the content beside
        the scene and the code, JSON-able. make: may return seconds that were spent on it before, in a run that was cut
        off; the module that it is written in and all that this imports are part of the key. using: functions that it
        was given and whose modules count as well. A half-made bake is never taken for a whole one.
        """
        key = {
            "kind": kind,
            "settings": dict(settings),
            "sources": digest(*(module_of(function) for function in (make, *using))),
            "scene": self._scene,
            "machine": self._machine,
        }
        name = hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()[:24]
        folder = self.root / f"{kind}-{name}"
        record = _whole(folder, key, self._views)
        is_new = record is None
        before = 0.0
        if record is None:
            before = _make(folder, key, make, self._views)
            record = parsed(gate.read_regular(folder / RECORD), BakeRecord)
        bake = Bake(kind, folder, record["seconds"], record["bytes"], before)
        self._views.book(record["views"])
        if bake.folder not in [used.folder for used in self.used]:
            self.used.append(bake)
        if is_new:
            self.made.append(bake)
        return bake

    @staticmethod
    def checkpoint(folder: Path) -> Path:
        """A file for what a making must not lose when it is killed; it goes once the bake is there.

        folder: what `make` was called with.
        """
        return folder.with_name(f"{folder.name.partition(PARTIAL)[0]}.checkpoint")


class BakeRecord(Checked):
    """`bake.json`."""

    key: dict[str, Any]
    seconds: Amount
    bytes: Count
    views: list[Count]


def _whole(folder: Path, key: Mapping[str, Any], views: TrainingSet) -> dict[str, Any] | None:
    """The record of a bake of this key whose files have the size that was written; None where it must be made anew."""
    if not gate.real_folder(folder):
        return None
    try:
        record = parsed(gate.read_inside(folder, RECORD), BakeRecord)
    except (gate.GateError, ValueError):
        return None
    whole = record["key"] == json.loads(json.dumps(key)) and record["bytes"] == _size(folder)
    return record if whole and all(number < len(views) for number in record["views"]) else None


def _size(folder: Path) -> int:
    """Bytes of the files of a bake, its record apart."""
    files = (path for path in folder.rglob("*") if path.is_file() and path != folder / RECORD)
    return sum(path.stat().st_size for path in files)


def _make(
    folder: Path, key: dict[str, Any], make: Callable[[Path], float | None], views: TrainingSet
) -> float:
    """Make a bake. Returns the seconds that were spent on it before."""
    with _held(folder.with_name(f".{folder.name}{PARTIAL}{process_number()}")) as partial:
        synchronise()
        start = time.perf_counter()
        with views.apart() as handed_out:
            before = make(partial) or 0.0
        synchronise()
        seconds = before + time.perf_counter() - start
        size = _size(partial)
        (partial / RECORD).write_bytes(
            as_json({"key": key, "seconds": seconds, "bytes": size, "views": handed_out})
        )
        sync_tree(partial)
        if folder.exists() and _whole(folder, key, views) is None:
            shutil.rmtree(folder)
        try:
            partial.rename(folder)
        except OSError as problem:
            # Another process has made the same in the meantime, and somebody may be reading it.
            if problem.errno not in (errno.EEXIST, errno.ENOTEMPTY) or _whole(folder, key, views) is None:
                raise
        BakeCache.checkpoint(partial).unlink(missing_ok=True)
    return before


@contextmanager
def _held(partial: Path) -> Iterator[Path]:
    """A new folder that `remove_abandoned` leaves alone while this process lives; gone afterwards."""
    shutil.rmtree(partial, ignore_errors=True)  # of a process that had the same number
    while True:
        partial.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(partial, os.O_RDONLY)
        with suppress(OSError):  # some file systems of networks have no locks; there nobody cleans up either
            _lock(descriptor, wait=True)
        # Somebody may have taken it for abandoned before it was locked.
        with suppress(FileNotFoundError):
            if os.fstat(descriptor).st_ino == partial.stat().st_ino:
                break
        os.close(descriptor)
    try:
        yield partial
    finally:
        shutil.rmtree(partial, ignore_errors=True)
        os.close(descriptor)


def remove_abandoned(root: Path) -> None:
    """Remove half-made bakes whose process is dead. Those that a living one is making stay, and so do links."""
    for partial in gate.own_leftovers(root, rf"{NAME}{re.escape(PARTIAL)}[0-9]+"):
        with suppress(OSError):  # no folder, not ours, gone by now, or held
            descriptor = os.open(partial, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                _lock(descriptor, wait=False)
                shutil.rmtree(partial)
            finally:
                os.close(descriptor)
    for beside in gate.own_leftovers(
        root, rf"{NAME}\.checkpoint\.[0-9]+"
    ):  # checkpoints that were being written
        stem, process = beside.name.split(".checkpoint.")
        if not (root / f"{stem}{PARTIAL}{process}").exists():
            beside.unlink(missing_ok=True)


def _lock(descriptor: int, *, wait: bool) -> None:
    """Lock a folder for as long as the descriptor is open. Raises OSError: held by another, or not possible."""
    try:
        import fcntl
    except ImportError:  # Windows locks no folders
        raise OSError(errno.ENOTSUP, "folders cannot be locked here") from None

    fcntl.flock(descriptor, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
