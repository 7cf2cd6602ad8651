"""The free space of a room, found with rays: where a camera or a probe can be.

The bounding box of a scene ends at the rim of the ground outside, so it says nothing of the room. A walk begins at a
point next to some shape that is free (what it sees are front faces) and enclosed (something is over it, under it and
around most of it), and goes on along rays to where they can reach. It never enters a solid, and what it finds behind a
window is not enclosed.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.errors import GibenchError
from gibench.rendering.scene import Scene

SPHERE, FEW, RING, CONE = 256, 32, 32, 16
"""Rays in all directions around a probe and around a point of the walk, around the horizon, and towards each of the
zenith and the nadir."""

CONE_HALF_ANGLE = np.radians(30.0)

LEAST_AROUND, LEAST_ABOVE = 0.5, 0.9
"""Shares of the horizon, and of the cones up and down, in which something must be seen. Half of what is around a point
in a window is its room; so is half of what is around a point behind a wall, but that has the sky above it."""

MOST_BACK_FACES = 0.1
"""Share of back faces that a free point may see; inside a closed solid it is near 1."""

STEPS = 4096
"""Rays along which the walk goes on at a time."""

ROUNDS, GROWTH = 32, 0.02
"""The walk ends after so many times, or when one adds less than this share of cells."""

CELLS = 32
"""Along the longest side of what the walk has found: it goes on from any of these cells with equal chance."""


class NoFreeSpace(GibenchError):
    """A scene in which no point is enclosed."""


def sphere(count: int) -> NDArray[np.float64]:
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


def cast(
    scene: Scene, origins: NDArray[Any], directions: NDArray[Any]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Distance (inf for a miss) and whether a front face was hit, (N,) each, of rays (N, 3) with unit directions."""
    if not len(origins):  # on which Dr.Jit ends the process
        return np.zeros(0, dtype=np.float32), np.zeros(0, dtype=bool)
    ray = mi.Ray3f(
        mi.Point3f(np.ascontiguousarray(origins.T, dtype=np.float32)),
        mi.Vector3f(np.ascontiguousarray(directions.T, dtype=np.float32)),
    )
    si = scene.mi_scene.ray_intersect(ray, mi.RayFlags.Minimal, False)
    front = si.is_valid() & (dr.dot(si.n, ray.d) < 0)
    dr.eval(si.t, front)
    return np.array(si.t), np.array(front)


def fan(
    scene: Scene, points: NDArray[Any], directions: NDArray[Any]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """`cast` along all directions from all points: (points, directions) each."""
    shape = (len(points), len(directions))
    distance, front = cast(
        scene, np.repeat(points, len(directions), axis=0), np.tile(directions, (len(points), 1))
    )
    return distance.reshape(shape), front.reshape(shape)


def enclosed(scene: Scene, points: NDArray[Any]) -> NDArray[np.bool_]:
    """(N,) whether points (N, 3) have something above, below and around them, as in a room."""
    hit = np.isfinite(fan(scene, points, _enclosing())[0])
    around, above, below = (part.mean(axis=1) for part in np.split(hit, [RING, RING + CONE], axis=1))
    return np.asarray((around >= LEAST_AROUND) & (above >= LEAST_ABOVE) & (below >= LEAST_ABOVE))


def surroundings(
    scene: Scene, points: NDArray[Any], rays: int = SPHERE
) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
    """(N,) whether points (N, 3) are free, which those inside of a solid are not; (N,) metres to the nearest thing."""
    distance, front = fan(scene, points, sphere(rays))
    hit = np.isfinite(distance)
    back = (hit & ~front).sum(axis=1)
    return back <= MOST_BACK_FACES * np.maximum(hit.sum(axis=1), 1), distance.min(axis=1)


def beginnings(scene: Scene) -> NDArray[np.float64]:
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


def free_space(scene: Scene, rounds: int = ROUNDS) -> NDArray[np.float64]:
    """(N, 3) points all over the free space of the room, evenly spread, metres.

    rounds: after which the walk ends at the latest; 6 of them find three quarters of the cells in two fifths of the
    time. Raises NoFreeSpace where no point of the scene is enclosed.
    """
    points = beginnings(scene)
    points = points[enclosed(scene, points)] if len(points) else points
    points = points[surroundings(scene, points)[0]] if len(points) else points
    if not len(points):
        raise NoFreeSpace("nothing in the scene is enclosed by a floor, a ceiling and walls")
    # The point that sees the largest volume, not counting what lies far behind a window: the room, not a cupboard.
    distance = fan(scene, points, sphere(SPHERE))[0]
    most = 3 * np.median(distance, axis=1, keepdims=True)
    rng = np.random.default_rng(0)
    found = points[[np.argmax((np.minimum(distance, most) ** 3).mean(axis=1))]]
    cells = found
    for _ in range(rounds):
        origins = cells[rng.integers(len(cells), size=STEPS)]
        directions = rng.normal(size=(STEPS, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        reach, front = cast(scene, origins, directions)
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


def seen_from(scene: Scene, points: NDArray[Any], lookouts: NDArray[Any]) -> NDArray[np.bool_]:
    """(N,) whether points (N, 3) are seen from any of the lookouts (M, 3)."""
    origin = np.tile(lookouts, (len(points), 1))
    towards = np.repeat(points, len(lookouts), axis=0) - origin
    length = np.linalg.norm(towards, axis=1, keepdims=True)
    distance, _ = cast(scene, origin, towards / np.maximum(length, 1e-9))
    clear: NDArray[np.bool_] = (distance > length[:, 0] * (1 - 1e-4)).reshape(len(points), len(lookouts))
    return np.asarray(clear.any(axis=1))
