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


def room_box(scene: Scene, margin: float = 0.02) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners (3,) of a box around the free space of the room; of the whole scene where nothing is enclosed.

    margin: that is added on each side, share of the longest one.
    """
    try:
        points = free_space(scene)
        low, high = points.min(axis=0), points.max(axis=0)
    except NoFreeSpace:
        box = scene.mi_scene.bbox()
        low, high = np.array(box.min, dtype=float).ravel(), np.array(box.max, dtype=float).ravel()
    more = margin * max(float((high - low).max()), 1e-3)
    return low - more, high + more


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
