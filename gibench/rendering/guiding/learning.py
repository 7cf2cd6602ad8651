"""Learns the guide of a scene.

Two passes of paths tell which lights a place sees and what every place sends; looks from surfaces all over tell where
that arrives from; a third pass of paths tells whether choosing directions by it pays, and how often.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.rendering.backend import is_scalar
from gibench.rendering.free_space import NoFreeSpace, beginnings, free_space, surroundings
from gibench.rendering.guiding.directions import BINS
from gibench.rendering.guiding.grid import Grid
from gibench.rendering.guiding.guide import Distributions, Guide
from gibench.rendering.guiding.mirrors import images_of
from gibench.rendering.guiding.paths import Samples, Starts, trace
from gibench.rendering.guiding.sights import look_around
from gibench.rendering.guiding.sums import Sums
from gibench.rendering.light_numbers import lights_of

LANES = 1 << 17
"""Paths of a pass."""

PASSES = 2
"""Of paths that tell of the lights. With 14 the variance was the same within 3 % in three of four rooms, and .94 of it
in the fourth."""

LOOKS = 1 << 21
"""Three times as many brought nothing in two rooms."""

DIRECTIONS_PAY = 0.09
"""Of the second moment of bounces, the share that a guide has to take away, in the mean over places, to choose
directions at all. They cost a tenth of the time of a path, and what they do not know shines in single pixels."""

ASKED_IN_MIRRORS = 0.2
"""Of the light samples of the first pass that ask for images of lights in mirrors."""

MARGIN = 0.6
"""Metres from the free space of a room to the edge of the grid."""

START_ROUNDS = 6
"""Of the walk that finds where paths start. They go on from there, so a nook that it leaves out is seen as well."""


def _starts(scene: Any) -> NDArray[np.float64]:
    """(N, 3) points all over the room; in a scene that encloses nothing, free ones next to its shapes."""
    try:
        return free_space(scene, START_ROUNDS)
    except NoFreeSpace:
        points = beginnings(scene)
        return points[surroundings(scene, points)[0]] if len(points) else points


def _unguided(emitters: Sequence[Any]) -> NDArray[np.float64]:
    """(L,) probabilities with which Mitsuba draws the lights: by their sampling weights."""
    weights = np.array([emitter.sampling_weight() for emitter in emitters], dtype=np.float64)
    return weights / weights.sum()


class _Learner:
    """Passes over a scene, each guided by what those before it have found."""

    def __init__(
        self, scene: Any, portals: Any, plain: NDArray[np.float64], points: NDArray[np.float64]
    ) -> None:
        """plain: (L,) probabilities of the lights without a guide. points: (N, 3), where paths start."""
        self.scene, self.portals, self.plain = scene, portals, plain
        self.images = images_of(scene.mi_scene, lights_of(scene.mi_scene), points)
        if self.images is not None:
            count = len(self.images.lights)
            self.plain = np.concatenate(
                [(1 - ASKED_IN_MIRRORS) * plain, np.full(count, ASKED_IN_MIRRORS / count)]
            )
        self.grid = Grid(points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN)
        # Two rows: arrays with one entry would make another kernel.
        self.learned = Distributions(
            np.zeros(self.grid.places, np.uint32),
            np.tile(self.plain, (2, 1)),
            np.ones((2, BINS)),
            np.zeros(2),
            np.zeros(2),
            np.zeros(2),
        )
        self._starts = Starts.of(points)
        self._numbers = itertools.count()

    def guide(self, *, directions: bool) -> Guide:
        return Guide(
            self.scene.mi_scene,
            self.portals,
            self.grid,
            self.learned,
            directions=directions,
            images=self.images,
        )

    def pass_of_paths(self, *, directions: bool) -> Samples:
        return trace(self.scene, self.guide(directions=directions), self._starts, LANES, next(self._numbers))

    def lights(self) -> Sums:
        """Learn which lights a place sees."""
        samples = self.pass_of_paths(directions=False)
        sums = Sums(self.grid.shape, samples.place, len(self.plain))
        sums.add(samples)
        for _ in range(PASSES - 1):
            self.learned = sums.learned(self.plain)
            sums.add(self.pass_of_paths(directions=False))
        self.learned = sums.learned(self.plain)
        return sums

    def directions(self, sums: Sums) -> bool:
        """Learn where light comes from; whether that pays."""
        sums.see(look_around(self.scene, self.guide(directions=False), self._starts, sums.radiance(), LOOKS))
        self.learned = sums.learned(self.plain)
        # From other paths than those that it has been learned from.
        samples = self.pass_of_paths(directions=True)
        sums.add_moments(samples, self.learned)
        sums.add(samples)
        self.learned = sums.learned(self.plain, sums.fractions())
        return sums.gain_of_directions() > DIRECTIONS_PAY


def learn(scene: Any) -> Guide | None:
    """The guide of a `Scene` as it is lit now; None where there is nothing to learn, or under the scalar variant."""
    if is_scalar() or not lights_of(scene.mi_scene):
        return None
    points = _starts(scene)
    if not len(points):
        return None
    portals = scene.portals if scene.portals is not None and float(scene.portals.fraction[0]) > 0 else None
    plain = _unguided(lights_of(scene.mi_scene))
    if portals is not None:
        fraction = float(portals.fraction[0])
        plain = np.append((1 - fraction) * plain, fraction)
    learner = _Learner(scene, portals, plain, points)
    directions = learner.directions(learner.lights())
    return learner.guide(directions=directions)
