"""Where probes stand: on a regular grid through the free space of a room (Rodriguez et al. 2020, section 4.1).

The room is found with rays, since the bounding box of a scene ends at the rim of the ground outside. A walk begins at a
point next to some shape that is free (what it sees are front faces) and enclosed (something is over it, under it and
around most of it), and goes on along rays to where they can reach. It never enters a solid, and what it finds behind a
window is not enclosed. The grid fills the box of what was found. A grid point inside a thing, too close to one, or that
the walk does not see, such as a cavity, is dropped: those that stay are as regular as before.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.baselines.probes.errors import ProbeError
from gibench.rendering.scene import Scene

VERSION = 1
"""Of this code: probes that stand elsewhere are another bake."""

SPHERE, FEW, RING, CONE = 256, 32, 32, 16
"""Rays in all directions around a probe and around a point of the walk, around the horizon, and towards each of the
zenith and the nadir."""

CONE_HALF_ANGLE = np.radians(30.0)

LEAST_AROUND, LEAST_ABOVE = 0.5, 0.9
"""Shares of the horizon, and of the cones up and down, in which something must be seen. Half of what is around a point
in a window is its room; so is half of what is around a point behind a wall, but that has the sky above it."""

MOST_BACK_FACES = 0.1
"""Share of back faces that a free point may see; inside a closed solid it is near 1."""

CLEARANCE = 0.1
"""Of the grid's step, to the nearest thing that the rays around a probe find."""

STEPS = 4096
"""Rays along which the walk goes on at a time."""

ROUNDS, GROWTH = 32, 0.02
"""The walk ends after so many times, or when one adds less than this share of cells."""

LOOKOUTS = 128
"""Points of the walk from which a grid point may be seen."""

CELLS = 32
"""Along the longest side of what the walk has found: it goes on from any of these cells with equal chance."""

TRIM = 1.0
"""Per cent of the cells that are left out at either end of each axis: what lies in the recess of a window."""

STRETCH = 1.5
"""Largest ratio of the grid's steps along two axes."""

ATTEMPTS = 8
"""Grids that are tried for the number of probes that was asked for."""


def _sphere(count: int) -> NDArray[np.float64]:
    """(count, 3) unit vectors, spread evenly along a spiral (Fibonacci lattice)."""
    i = np.arange(count) + 0.5
    z = 1 - 2 * i / count
    azimuth = i * np.pi * (3 - np.sqrt(5))
    flat = np.sqrt(1 - z**2)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), z], axis=1)


def _enclosing() -> NDArray[np.float64]:
    """(RING + 2 CONE, 3): the horizon, then cones up and down."""
    azimuth = 2 * np.pi * (np.arange(RING) + 0.5) / RING
    ring = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(RING)], axis=1)
    z = 1 - (np.arange(CONE) + 0.5) / CONE * (1 - np.cos(CONE_HALF_ANGLE))
    turn = np.arange(CONE) * np.pi * (3 - np.sqrt(5))
    flat = np.sqrt(1 - z**2)
    cone = np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
    return np.concatenate([ring, cone, cone * [1, 1, -1]])


def _cast(
    scene: Scene, origins: NDArray[Any], directions: NDArray[Any]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Distance (inf for a miss) and whether a front face was hit, (N,) each, of rays (N, 3) with unit directions."""
    ray = mi.Ray3f(
        mi.Point3f(np.ascontiguousarray(origins.T, dtype=np.float32)),
        mi.Vector3f(np.ascontiguousarray(directions.T, dtype=np.float32)),
    )
    si = scene.mi_scene.ray_intersect(ray, mi.RayFlags.Minimal, False)
    front = si.is_valid() & (dr.dot(si.n, ray.d) < 0)
    dr.eval(si.t, front)
    return np.array(si.t), np.array(front)


def _fan(
    scene: Scene, points: NDArray[Any], directions: NDArray[Any]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """`_cast` along all directions from all points: (points, directions) each."""
    shape = (len(points), len(directions))
    distance, front = _cast(
        scene, np.repeat(points, len(directions), axis=0), np.tile(directions, (len(points), 1))
    )
    return distance.reshape(shape), front.reshape(shape)


def enclosed(scene: Scene, points: NDArray[Any]) -> NDArray[np.bool_]:
    """(N,) whether points (N, 3) have something above, below and around them, as in a room."""
    seen = np.isfinite(_fan(scene, points, _enclosing())[0])
    around, above, below = (part.mean(axis=1) for part in np.split(seen, [RING, RING + CONE], axis=1))
    return np.asarray((around >= LEAST_AROUND) & (above >= LEAST_ABOVE) & (below >= LEAST_ABOVE))


def surroundings(
    scene: Scene, points: NDArray[Any], rays: int = SPHERE
) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
    """(N,) whether points (N, 3) are free, which those inside of a solid are not; (N,) metres to the nearest thing."""
    distance, front = _fan(scene, points, _sphere(rays))
    hit = np.isfinite(distance)
    back = (hit & ~front).sum(axis=1)
    return back <= MOST_BACK_FACES * np.maximum(hit.sum(axis=1), 1), distance.min(axis=1)


def _beginnings(scene: Scene) -> NDArray[np.float64]:
    """(N, 3) the middle of every shape's bounding box and points next to its six sides."""
    points = []
    for shape in scene.mi_scene.shapes():
        box = shape.bbox()
        low, high = np.array(box.min, dtype=float).ravel(), np.array(box.max, dtype=float).ravel()
        middle = 0.5 * (low + high)
        away = 0.5 * (high - low) + 0.05 * np.linalg.norm(high - low) / np.sqrt(3) + 1e-3
        points.append(middle)
        for axis in range(3):
            for side in (-1, 1):
                points.append(middle + side * away * (np.arange(3) == axis))
    return np.array(points).reshape(-1, 3)


def _spread(rng: np.random.Generator, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """One of the points (N, 3) from each cell that has any."""
    low = points.min(axis=0)
    side = max(float((points.max(axis=0) - low).max()) / CELLS, 1e-6)
    shuffled = points[rng.permutation(len(points))]
    chosen = np.unique(np.floor((shuffled - low) / side).astype(np.int64), axis=0, return_index=True)[1]
    return shuffled[chosen]


def free_space(scene: Scene) -> NDArray[np.float64]:
    """(N, 3) points all over the free space of the room, evenly spread, metres.

    Raises ProbeError where no point of the scene is enclosed.
    """
    points = _beginnings(scene)
    points = points[enclosed(scene, points)] if len(points) else points
    points = points[surroundings(scene, points)[0]] if len(points) else points
    if not len(points):
        raise ProbeError(
            "no place for probes: nothing in the scene is enclosed by a floor, a ceiling and walls "
            "(probes are for rooms)"
        )
    # The point that sees the largest volume, not counting what lies far behind a window: the room, not a cupboard.
    distance = _fan(scene, points, _sphere(SPHERE))[0]
    most = 3 * np.median(distance, axis=1, keepdims=True)
    rng = np.random.default_rng(0)
    found = points[[np.argmax((np.minimum(distance, most) ** 3).mean(axis=1))]]
    cells = found
    for _ in range(ROUNDS):
        origins = cells[rng.integers(len(cells), size=STEPS)]
        directions = rng.normal(size=(STEPS, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        reach, front = _cast(scene, origins, directions)
        reach, origins, directions = reach[front], origins[front], directions[front]
        along = rng.uniform(0.05, 0.98, size=len(reach)) * reach
        new = origins + along[:, None] * directions
        new = new[enclosed(scene, new)]
        new = new[surroundings(scene, new, FEW)[0]]
        found = np.concatenate([found, new])
        before, cells = len(cells), _spread(rng, found)
        if len(cells) < (1 + GROWTH) * before:
            break
    return cells


def _seen(scene: Scene, points: NDArray[Any], lookouts: NDArray[Any]) -> NDArray[np.bool_]:
    """(N,) whether points (N, 3) are seen from any of the lookouts (M, 3)."""
    origin = np.tile(lookouts, (len(points), 1))
    towards = np.repeat(points, len(lookouts), axis=0) - origin
    length = np.linalg.norm(towards, axis=1, keepdims=True)
    distance, _ = _cast(scene, origin, towards / np.maximum(length, 1e-9))
    clear: NDArray[np.bool_] = (distance > length[:, 0] * (1 - 1e-4)).reshape(len(points), len(lookouts))
    return np.asarray(clear.any(axis=1))


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
        return points[_seen(self.scene, points, self.lookouts)] if len(points) else points


def place(scene: Scene, count: int) -> NDArray[np.float32]:
    """(N, 3) positions of about `count` (≥ 1) probes on a regular grid, metres, by x, then y, then z.

    N is as near to `count` as grids of nearly equal steps come. Raises ProbeError.
    """
    if count < 1:
        raise ProbeError(f"{count} probes: at least 1 is needed")
    found = free_space(scene)
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
