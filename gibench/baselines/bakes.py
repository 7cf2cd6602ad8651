"""Baked files, kept by what they depend on and shared by all methods that ask for the same.

What a bake cost is kept with it, so that a method is charged for a lightmap that another one made first.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gibench.baselines.stages import synchronise
from gibench.datasets.files import as_json, sync_tree

RECORD = "bake.json"


@dataclass(frozen=True)
class Bake:
    """A folder of baked files. seconds: that making them took, whoever did. size: in bytes on disk."""

    kind: str
    folder: Path
    seconds: float
    size: int


class BakeCache:
    """Bakes of one scene below one folder.

    scene: what identifies the scene, its content included (a SHA-256). machine: what else a bake's time and bits
    depend on: variant, versions, hardware.
    """

    def __init__(self, root: Path, scene: str, machine: Mapping[str, Any]) -> None:
        """root: made when something is baked."""
        self.root, self._scene, self._machine = root, scene, dict(machine)
        self.used: list[Bake] = []

    def get(self, kind: str, settings: Mapping[str, Any], make: Callable[[Path], float | None]) -> Bake:
        """The bake of these settings, made by `make(folder)` where it is not there yet.

        kind: "lightmap", "probes" …, what its time is booked under. settings: all that decides the content beside
        the scene, JSON-able; a version number of the code that makes it among them. A half-made bake is never
        taken for a whole one. make: may return seconds that were spent on it before, in a run that was cut off.
        """
        key, folder = self._place(kind, settings)
        if not (folder / RECORD).is_file():
            self._make(folder, key, make)
        record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        bake = Bake(kind, folder, record["seconds"], record["bytes"])
        if bake.folder not in [used.folder for used in self.used]:
            self.used.append(bake)
        return bake

    def checkpoint(self, kind: str, settings: Mapping[str, Any]) -> Path:
        """A file beside the bake of these settings for what its making must not lose when it is killed.

        Whoever writes it removes it once the bake is there.
        """
        _, folder = self._place(kind, settings)
        return folder.with_name(f".{folder.name}.checkpoint")

    def _place(self, kind: str, settings: Mapping[str, Any]) -> tuple[dict[str, Any], Path]:
        key = {"kind": kind, "settings": dict(settings), "scene": self._scene, "machine": self._machine}
        digest = hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()[:24]
        return key, self.root / f"{kind}-{digest}"

    def _make(self, folder: Path, key: dict[str, Any], make: Callable[[Path], float | None]) -> None:
        partial = folder.with_name(f".{folder.name}.partial-{os.getpid()}")
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
        try:
            synchronise()
            start = time.perf_counter()
            before = make(partial) or 0.0
            synchronise()
            seconds = before + time.perf_counter() - start
            size = sum(path.stat().st_size for path in partial.rglob("*") if path.is_file())
            (partial / RECORD).write_bytes(as_json({"key": key, "seconds": seconds, "bytes": size}))
            sync_tree(partial)
            if folder.exists():  # without its record, so not whole
                shutil.rmtree(folder)
            partial.rename(folder)
        except BaseException:
            shutil.rmtree(partial, ignore_errors=True)
            raise
