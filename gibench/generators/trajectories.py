"""Stills along trajectories through a scene, and others that lie away from all of them.

Methods that learn a scene from views of it are tested on views between those of the training trajectories, and on views
far from all of them (Raghavan et al. 2023, section 5 and table 1: near and far views).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gibench.generators.parts import Camera, FloatArray

FAR = 0.7
"""Least difference between a far still and every view on a trajectory, as `differences` counts it: 1.4 m, 40 degrees,
or less of both together."""

TRIES = 40
"""Batches of candidates before the trajectories are drawn again, or the room."""

Draw = tuple[Sequence[Camera], Counter[str]]


@dataclass(frozen=True)
class Spread:
    """Where the stills of a scene lie.

    trajectories: on how many of them. held_out: of the stills, so many come last; those that are not far lie between
    the others, evenly along the trajectories. far: of these, so many lie away from all trajectories.
    """

    trajectories: int
    held_out: int = 0
    far: int = 0


class NoFarView(Exception):
    """The trajectories go everywhere: no view lies away from them."""


def differences(camera: Camera, others: Sequence[Camera]) -> FloatArray:
    """(N,) how much a camera differs from each of others: half their distance in metres, plus the angle between their
    directions in radians.
    """
    if not others:
        return np.zeros(0)
    places = np.array([other.position for other in others])
    looks = np.array([other.target for other in others]) - places
    look = np.subtract(camera.target, camera.position)
    cosines = looks @ look / (np.linalg.norm(looks, axis=1) * np.linalg.norm(look))
    return np.asarray(
        0.5 * np.linalg.norm(places - camera.position, axis=1) + np.arccos(np.clip(cosines, -1, 1))
    )


def spread_stills(
    count: int,
    spread: Spread,
    trajectory: Callable[[int], Draw],
    candidates: Callable[[], Draw],
    beside: Sequence[Camera] = (),
) -> tuple[tuple[Camera, ...], Counter[str]]:
    """`count` stills: those to train on, then those between them, then those that are far from all the others.

    trajectory: draws one of so many views. candidates: draws some views anywhere, as many as it likes. Both also give
    how often views were refused, by reason, of which the sum is returned. beside: other views that the far ones lie
    away from. Raises NoFarView, and whatever the drawers do.
    """
    refused: Counter[str] = Counter()
    along: list[Camera] = []
    near = count - spread.far
    for number in range(spread.trajectories):
        share = near * (number + 1) // spread.trajectories - near * number // spread.trajectories
        if not share:
            continue
        drawn, reasons = trajectory(share)
        along += [replace(camera, path="", step=0) for camera in drawn]
        refused += reasons
    between = spread.held_out - spread.far
    # The middle of each of as many equal stretches.
    places = {(2 * k + 1) * near // (2 * between) for k in range(between)}
    to_train = [camera for number, camera in enumerate(along) if number not in places]
    held_out = [along[number] for number in sorted(places)]
    far: list[Camera] = []
    tries = 0
    while len(far) < spread.far:
        if tries == TRIES * (1 + len(far)):
            raise NoFarView
        tries += 1
        drawn, reasons = candidates()
        refused += reasons
        for camera in drawn[: spread.far - len(far)]:
            if differences(camera, [*along, *beside]).min() >= FAR:
                far.append(camera)
            else:
                refused["near a trajectory"] += 1
    return (*to_train, *held_out, *far), refused
