"""The room as a volume sees it: where its cells are, and how much of the light between two of them is blocked.

Kaplanyan & Dachsbacher 2010, section 4.3: surfaces are put into a grid shifted by half a cell, as what share of a
cell's face they cover, by direction. The paper takes them from shadow maps and the camera, anew each frame, and keeps
them in two bands of spherical harmonics. Here things stay: they are found once, with rays all over the free space,
whatever the camera will see of them. Light travels along six directions alone, so the shares of these six are kept: in
two bands a wall would also cover a quarter of what passes along it.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.baselines.light_propagation_volumes.volume import AXES, Grid
from gibench.rendering.free_space import NoFreeSpace, free_space
from gibench.rendering.scene import Scene

RAYS = 1 << 20
"""Along which surfaces are looked for."""

TIE = 1e-3
"""Of the side of a cell: how far apart two faces are equally near."""


NEAR = 0.1
"""Of the longest side of a room: how far from the end of its free space a wall may be."""

LEAST_WALL = 0.2
"""Of a side of the room that a wall must cover."""

BINS = 200
"""Places of a wall along the way that `NEAR` leaves it, on either side of the end of free space."""


def room_grid(scene: Scene, cells: int) -> Grid:
    """The grid over the room, `cells` along its longest side, or up to an eighth fewer: its faces lie on the walls.

    Where nothing is enclosed, over the whole scene.
    """
    try:
        points = free_space(scene)
        low, high = points.min(axis=0), points.max(axis=0)
    except NoFreeSpace:
        box = scene.mi_scene.bbox()
        low, high = np.array(box.min, dtype=float).ravel(), np.array(box.max, dtype=float).ravel()
    more = NEAR * max(float((high - low).max()), 1e-3)
    around = Grid.around(low - more, high + more, cells)
    return Grid.around(*walls(low, high, *surfaces(scene, around)), cells).reaching(low, high)


def walls(
    low: NDArray[Any], high: NDArray[Any], points: NDArray[Any], normals: NDArray[Any], areas: NDArray[Any]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where the walls of a room are, floor and ceiling included: the corners (3,) of the box between them.

    On each side that is where most surface lies that faces the room, near the end of its free space; that end itself
    where hardly any does. Niches lie behind the walls, and cupboards before them.

    low, high: of free space, (3,). points, normals, areas: of `surfaces`.
    """
    extent = high - low
    near = NEAR * max(float(extent.max()), 1e-3)
    found = np.array([low, high], dtype=float)
    for side, ends in enumerate((low, high)):
        for axis in range(3):
            facing = normals[:, axis] * (1 - 2 * side) > 0.95
            others = [a for a in range(3) if a != axis]
            at = points[:, axis] - ends[axis]
            chosen = facing & (np.abs(at) < near)
            if not chosen.any():
                continue
            place = np.clip(np.floor((at[chosen] / near + 1) * BINS).astype(int), 0, 2 * BINS - 1)
            total = np.bincount(place, areas[chosen], minlength=2 * BINS)
            # A wall that lies where two bins meet is in both.
            both = np.convolve(total, np.ones(3), mode="same")
            best = int(np.argmax(both))
            if both[best] >= LEAST_WALL * extent[others].prod():
                of_wall = np.abs(place - best) <= 1
                found[side, axis] = ends[axis] + np.average(
                    at[chosen][of_wall], weights=areas[chosen][of_wall]
                )
    return found[0], found[1]


def surfaces(scene: Scene, grid: Grid, rays: int = RAYS) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Pieces of surface in the box of a grid, as seen from free space: points (N, 3), normals (N, 3), areas (N,), m².

    A chord through a random point of the box in a random direction finds a piece of surface as often as it is large and
    the chord long: 2 · volume / (chords · length) is the area that each of its ends stands for.
    """
    low, extent = np.array(grid.low), grid.side * np.array(grid.counts)
    index = dr.arange(mi.UInt32, rays)
    u = [mi.sample_tea_float32(index, mi.UInt32(k)) for k in range(5)]
    origin = mi.Point3f(*(float(low[k]) + u[k] * float(extent[k]) for k in range(3)))
    direction = mi.warp.square_to_uniform_sphere(mi.Point2f(u[3], u[4]))
    ways = (direction, -direction)
    ends = [scene.mi_scene.ray_intersect(mi.Ray3f(origin, way), mi.RayFlags.Minimal, False) for way in ways]
    # Outside of the room, and in a window, chords end nowhere: those through the box are no longer than its diagonal.
    longest = float(np.linalg.norm(extent))
    chord = dr.minimum(ends[0].t, longest) + dr.minimum(ends[1].t, longest)
    area = (2 * float(extent.prod()) / rays) / dr.maximum(chord, 1e-3 * longest)
    fronts = [end.is_valid() & (dr.dot(end.n, way) < 0) for end, way in zip(ends, ways, strict=True)]
    dr.eval(area, fronts, [(end.p, end.n) for end in ends])
    found = []
    for end, front in zip(ends, fronts, strict=True):
        chosen = np.array(front)
        found.append((np.array(end.p).T[chosen], np.array(end.n).T[chosen], np.array(area)[chosen]))
    points, normals, areas = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return points, normals, areas


def passing(
    grid: Grid, points: NDArray[Any], normals: NDArray[Any], areas: NDArray[Any]
) -> NDArray[np.float32]:
    """(6, cells): shares of light that come through into each cell, for each direction of travel, `AXES`.

    A piece of surface belongs to the nearest face between two cells, and covers its area as seen along the axis, area ·
    max(n · axis, 0), for light that comes towards its front. All five rays of a step go through that face and are
    blocked alike: what one of them meets behind it, such as the wall beside the next cell, is where it is going.

    points, normals, areas: of `surfaces`.
    """
    at = (points - grid.low) / grid.side
    cell = np.floor(at).astype(np.int64)
    # A wall in the middle between two faces is on the one behind it, as a whole, however its points are rounded.
    face = np.rint(at - TIE * normals).astype(np.int64)
    covered = np.zeros((len(AXES), grid.size))
    for number, travel in enumerate(AXES):
        axis = number // 2
        into = cell.copy()
        into[:, axis] = face[:, axis] - (travel[axis] < 0)
        inside = ((into >= 0) & (into < grid.counts)).all(axis=1)
        towards = np.maximum(-normals[:, axis] * travel[axis], 0) * inside
        index = np.ravel_multi_index(into.T, grid.counts, mode="clip", order="F")  # x runs fastest
        covered[number] = np.bincount(index, towards * areas, minlength=grid.size)
    return (1 - np.minimum(covered / grid.side**2, 1)).astype(np.float32)
