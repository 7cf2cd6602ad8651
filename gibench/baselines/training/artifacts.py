"""A training that is over, on disk: weights that outlive it, and what it was like."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from gibench.baselines.training.curves import Trained
from gibench.baselines.training.errors import CheckpointError
from gibench.baselines.training.files import read_tensors, unreadable, write_tensors
from gibench.baselines.training.learner import Weights

WEIGHTS, RECORD = "weights.pt", "training.json"
"""Names in the folder of a trained method: tensors; steps, seconds, and the curve of held-out error."""

Facts = dict[str, float | int | str | bool]


def keep(folder: Path, trained: Trained, **facts: float | int | str | bool) -> None:
    """Write weights and record. facts: what the weights mean nothing without, such as the scale of their scene.

    Raises StorageError where the disk refuses.
    """
    content = {"weights": trained.weights, "facts": facts}
    write_tensors(folder / WEIGHTS, content)
    (folder / RECORD).write_text(json.dumps(trained.record(), indent=1) + "\n", encoding="utf-8")


def kept(folder: Path) -> tuple[Weights, Facts]:
    """Weights and facts of a folder, on the CPU. Raises CheckpointError where they cannot be read."""
    content = read_tensors(folder / WEIGHTS)
    try:
        return content["weights"], content["facts"]
    except KeyError as problem:
        raise CheckpointError(unreadable(folder / WEIGHTS, problem)) from problem


def record(folder: Path) -> dict[str, Any] | None:
    """Record of the training of a folder, as `Trained.record` gives it; None where it holds no training."""
    path = folder / RECORD
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
