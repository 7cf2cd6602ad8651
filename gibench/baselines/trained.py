"""Weights of methods that train: files that are trained once, found again, and charged to whoever uses them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from gibench.baselines.bakes import Bake, BakeCache
from gibench.baselines.method import Method, Setting, Training
from gibench.baselines.stages import Stages
from gibench.baselines.training_set import TrainingSet

CURVE = "training.json"
"""Record of a training beside its weights: an object with `curve`, a list of looks at what is held out, each
with `step`, `seconds` and `error`. `gibench.baselines.training.Trained.record` makes one."""


def trained(
    cache: BakeCache,
    method: Method,
    settings: Mapping[str, Setting],
    views: TrainingSet,
    *,
    seconds: float | None,
    seed: int,
) -> Bake:
    """The weights of a method, trained where they are not there yet.

    cache: where they are kept. settings: all knobs. seconds: see `Training`.
    """
    implementation = method.load()

    def make(folder: Path) -> float | None:
        training = Training(views, seconds, seed, folder, cache.checkpoint(folder), Stages())
        before: float | None = implementation(settings).train(training)  # type: ignore[attr-defined]
        return before

    key = {
        "method": method.implementation,
        "settings": method.trained_settings(settings),
        "views": views.sha256,
        "seconds": seconds,
        "seed": seed,
    }
    return cache.get("training", key, make, using=[implementation])


def curve_of(folder: Path) -> list[dict[str, Any]]:
    """The looks of a training, from the folder of its weights; none where it kept none.

    kept: whether the weights are those of this look: the best since the learner began to count (`Learner.anew_at`).
    """
    with suppress(OSError, ValueError, TypeError, KeyError):
        record = json.loads((folder / CURVE).read_text(encoding="utf-8"))
        best = record["best"]["step"]
        return [
            {**{name: look[name] for name in ("step", "seconds", "error")}, "kept": look["step"] == best}
            for look in record["curve"]
        ]
    return []
