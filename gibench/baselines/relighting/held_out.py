"""Frames that a training on one scene is judged by: under environments that it never sees, from all over the scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gibench.baselines.image_to_image.frames import held_out as views_held_out
from gibench.baselines.image_to_image.frames import spaced
from gibench.baselines.training_set import TrainingSet

FEWEST = 4
"""Environments of which one can be spared."""


def held_out(views: TrainingSet, share: float, most: int) -> tuple[list[int], list[int]]:
    """Numbers of the frames to learn from, and of those that are held out.

    A share of the environments is held out whole, in all of their rotations, one at least; of their frames, `most`
    spread evenly over the trajectories are looked at. Under fewer than FEWEST environments, or in several rooms, it is
    as for any network: views or rooms. Raises TrainingError where there are fewer than two frames.
    """
    lit = _environments(views)
    names = {environment: name for environment, name in lit if environment}
    if len(names) < FEWEST or len(views.rooms) > 1:
        return views_held_out(views, share, most)
    apart = spread(names, share)
    learned = [number for number, (environment, _) in enumerate(lit) if environment not in apart]
    others = [number for number, (environment, _) in enumerate(lit) if environment in apart]
    return learned, spaced(others, most)


def spread(names: Mapping[str, str], share: float) -> set[str]:
    """A share of environments, SHA-256 → name, one at least: evenly spread over their names, the first and the last
    among them where there is more than one. Maps of one origin have names that begin alike, so all kinds are met.
    """
    ordered = sorted(names, key=lambda environment: (names[environment], environment))
    count = max(1, round(share * len(ordered)))
    steps = max(1, count - 1)
    return {ordered[k * (len(ordered) - 1) // steps] for k in range(count)}


def _environments(views: TrainingSet) -> Sequence[tuple[str, str]]:
    """SHA-256 and name of the environment of each frame; empty where it has none."""
    if not len(views) or "environment_sha256" not in views.frames:
        return []
    columns = (views.frames[name].fillna("").astype(str) for name in ("environment_sha256", "environment"))
    return list(zip(*columns, strict=True))
