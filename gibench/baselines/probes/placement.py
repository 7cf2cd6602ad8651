"""Placement of probes: on a regular grid through the free space of a room (Rodriguez et al. 2020, section 4.1).

The room is found with rays (`gibench.rendering.free_space`). The grid fills the box of what was found. A grid point
inside a thing, too close to one, or that the walk does not see, such as a cavity, is dropped: those that stay are as
regular as before.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gibench.baselines.probes.errors import ProbeError
from gibench.rendering.free_space import NoFreeSpace, enclosed, free_space, seen_from, surroundings
from gibench.rendering.scene import Scene

CLEARANCE = 0.1
"""Of the grid's step, to the nearest thing that the rays around a probe find."""

LOOKOUTS = 128
"""Points of the walk from which a grid point may be seen."""

TRIM = 1.0
"""Per cent of the cells that are left out at either end of each axis: what lies in the recess of a window."""

STRETCH = 1.5
"""Largest ratio of the grid's steps along two axes."""

ATTEMPTS = 8
"""Grids that are tried for the number of probes that was asked for."""


@dataclass(frozen=True)
class _Room:
    scene: Scene
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    lookouts: NDArray[np.float64]

    @property
    def extent(self) -> NDArray[np.float64]:
        """(3,) metres."""
        return np.maximum(self.high - self.low, 1e-6)

    def counts(self, total: float) -> list[tuple[int, ...]]:
        """Points along the axes of grids of about `total` points and nearly equal steps, the best first."""
        step = float((self.extent.prod() / total) ** (1 / 3))
        about = np.maximum(np.floor(self.extent / step), 1).astype(int)
        grids = [tuple(about + offset) for offset in itertools.product((-1, 0, 1, 2), repeat=3)]

        def stretch(grid: tuple[int, ...]) -> float:
            steps = self.extent / grid
            return float(steps.max() / steps.min())

        # Where the room is flat, the one that is stretched least is as good as it gets.
        grids = [grid for grid in grids if min(grid) >= 1]
        even = [grid for grid in grids if stretch(grid) <= STRETCH] or [min(grids, key=stretch)]
        return sorted(even, key=lambda grid: (abs(np.prod(grid) - total), stretch(grid)))

    def probes(self, counts: tuple[int, ...]) -> NDArray[np.float64]:
        """(N, 3) the points of a grid that a probe may stand at."""
        steps = self.extent / counts
        axes = [
            low + (np.arange(n) + 0.5) * step for low, n, step in zip(self.low, counts, steps, strict=True)
        ]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        free, near = surroundings(self.scene, points)
        points = points[free & (near >= CLEARANCE * steps.min())]
        points = points[enclosed(self.scene, points)] if len(points) else points
        return points[seen_from(self.scene, points, self.lookouts)] if len(points) else points


def place(scene: Scene, count: int) -> NDArray[np.float32]:
    """(N, 3) positions of about `count` (≥ 1) probes on a regular grid, metres, by x, then y, then z.

    N is as near to `count` as grids of nearly equal steps come. Raises ProbeError.
    """
    if count < 1:
        raise ProbeError(f"{count} probes: at least 1 is needed")
    try:
        found = free_space(scene)
    except NoFreeSpace as problem:
        raise ProbeError(f"no place for probes: {problem} (probes are for rooms)") from None
    lookouts = found[np.random.default_rng(1).permutation(len(found))[:LOOKOUTS]]
    low, high = np.percentile(found, [TRIM, 100 - TRIM], axis=0)
    room = _Room(scene, low, high, lookouts)
    best = np.zeros((0, 3))
    tried: set[tuple[int, ...]] = set()
    kept = 1.0  # share of a grid's points that stay
    for _ in range(ATTEMPTS):
        grid = next((grid for grid in room.counts(count / kept) if grid not in tried), None)
        if grid is None:
            break
        tried.add(grid)
        points = room.probes(grid)
        kept = max(len(points), 1) / float(np.prod(grid))
        if not len(best) or abs(len(points) - count) < abs(len(best) - count):
            best = points
        if len(best) == count:
            break
    if not len(best):
        raise ProbeError("no place for probes: everything in the room is too close to something")
    return best.astype(np.float32)
