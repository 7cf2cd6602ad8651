"""Cost of preparations, by the kind of work."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gibench.baselines.bakes import Bake
from gibench.baselines.trained import curve_of
from gibench.baselines.training_set import TrainingSet

#: What a preparation is booked under, beside what none of them names.
BOOKED = ("lightmap", "probes", "references", "training")


def preparation(
    wall: float,
    stages: dict[str, float],
    used: list[Bake],
    made: list[Bake],
    views: Sequence[TrainingSet],
) -> dict[str, Any]:
    """Cost of a preparation, whoever paid for it first.

    wall: seconds of `prepare`. stages: seconds by stage in it. used: bakes that it read, made: those of them that were
    not there before. A bake that was there counts with what making it took; so do the views that were handed out.
    Returns seconds (all of it), one entry for each of `BOOKED`, other, bytes of the bakes, wall, and lists; `curves`
    are those of the trainings (`gibench.baselines.trained.curve_of`).
    """

    def here(bake: Bake) -> float:
        return bake.seconds - bake.before

    booked = dict.fromkeys(BOOKED, 0.0)
    booked["references"] = sum(one.seconds for one in views)
    other = 0.0
    for bake in used:
        if bake.kind in booked:
            booked[bake.kind] += bake.seconds
        else:
            other += bake.seconds
    in_stages = 0.0
    for name, seconds in stages.items():
        # A stage around the making of a bake of its name holds the same seconds once more.
        seconds = max(0.0, seconds - sum(here(bake) for bake in made if bake.kind == name))
        in_stages += seconds
        if name in booked:
            booked[name] += seconds
        else:
            other += seconds
    other += max(0.0, wall - in_stages - sum(map(here, made)))
    return {
        "seconds": sum(booked.values()) + other,
        **booked,
        "other": other,
        "bytes": sum(bake.size for bake in used),
        "wall_seconds": wall,
        "made_seconds": sum(bake.seconds for bake in made),
        "stages": dict(stages),
        "bakes": [
            {"kind": bake.kind, "folder": bake.folder.name, "seconds": bake.seconds, "bytes": bake.size}
            for bake in used
        ],
        "training_views_read": sum(len(one.handed_out) for one in views),
        "curves": [curve for bake in used if bake.kind == "training" and (curve := curve_of(bake.folder))],
    }
