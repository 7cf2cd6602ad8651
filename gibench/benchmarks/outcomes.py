"""Records of results, as their JSON files hold them."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import gibench
from gibench.benchmarks.processes import log_tail
from gibench.benchmarks.registry import Found
from gibench.benchmarks.result_files import FORMAT
from gibench.benchmarks.scenes import SceneFiles
from gibench.benchmarks.settings import Choice

#: Where a result failed, and how a reader is told.
PHASES = {
    "start": "before the preparation",
    "train": "in the training",
    "prepare": "in the preparation",
    "render": "while rendering",
}


@dataclass(frozen=True)
class Job:
    """One result that is to be there."""

    found: Found
    choice: Choice
    scene: SceneFiles
    seed: int
    config: dict[str, Any]
    key: str

    @property
    def id(self) -> str:
        """Sixteen hexadecimal digits."""
        return self.key[:16]


def _base(job: Job, machine: dict[str, Any]) -> dict[str, Any]:
    method = job.found.method
    return {
        "format": FORMAT,
        "gibench": gibench.__version__,
        "id": job.id,
        "key": job.key,
        "config": job.config,
        "title": method.title,
        "family": method.family,
        "paper": method.paper,
        "label": job.choice.label,
        "room": job.scene.room,
        "tags": [list(job.scene.tags(frame)) for frame in range(len(job.scene))],
        "kind": job.scene.kind,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": machine,
    }


def good(
    job: Job, machine: dict[str, Any], prepared: dict[str, Any], rendered: dict[str, Any]
) -> dict[str, Any]:
    """The record of a result. prepared, rendered: what the process told; machine: facts."""
    return {
        **_base(job, machine),
        "status": "ok",
        "prepare": prepared,
        "warmup_seconds": rendered["warmup_seconds"],
        "frames": rendered["frames"],
        "peak_mb": rendered["peak_mb"],
        "gpu_mb": rendered["gpu_mb"],
        "files": rendered["files"],
    }


def bad(
    job: Job,
    machine: dict[str, Any],
    phase: str,
    content: dict[str, str],
    prepared: dict[str, Any] | None,
    log: Path,
) -> dict[str, Any]:
    """The record of a result that failed. phase: a key of `PHASES`. content: reason and traceback."""
    return {
        **_base(job, machine),
        "status": "failed",
        "phase": phase,
        "reason": _printable(f"{PHASES[phase]}: {content['reason']}"),
        "traceback": _printable(content["traceback"]),
        "log": log_tail(log),
        "prepare": prepared,
    }


def _printable(text: str) -> str:
    """Text that UTF-8 can hold, whatever an exception said."""
    return text.encode("utf-8", "replace").decode()
