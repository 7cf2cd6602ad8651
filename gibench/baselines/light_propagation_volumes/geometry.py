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


def covered(scene: Scene, grid: Grid, rays: int = RAYS) -> NDArray[np.float32]:
    """(X + 1, Y + 1, Z + 1, 6) ≥ 0: of each corner of the cells, what covers a cell's face, by where it faces, `AXES`.

    In areas of a face. A surface with the normal n covers what it is seen as along the axis, its area · max(n · axis, 0).
    A chord through a random point of the box in a random direction finds a piece of surface as often as it is large and
    the chord long: 4 · volume / (chords · length) is the area that it stands for.
    """
    low, side = np.array(grid.low), grid.side
    extent = side * np.array(grid.counts)
    index = dr.arange(mi.UInt32, rays)
    u = [mi.sample_tea_float32(index, mi.UInt32(k)) for k in range(5)]
    origin = mi.Point3f(*(float(low[k]) + u[k] * float(extent[k]) for k in range(3)))
    direction = mi.warp.square_to_uniform_sphere(mi.Point2f(u[3], u[4]))
    there, back = (
        scene.mi_scene.ray_intersect(mi.Ray3f(origin, way), mi.RayFlags.Minimal, False)
        for way in (direction, -direction)
    )
    front = there.is_valid() & (dr.dot(there.n, direction) < 0)
    # Outside of the room, and in a window, chords end nowhere: those through the box are no longer than its diagonal.
    longest = float(np.linalg.norm(extent))
    chord = dr.minimum(there.t, longest) + dr.minimum(back.t, longest)
    area = (4 * float(extent.prod()) / rays) / dr.maximum(chord, 1e-3 * longest)
    dr.eval(front, area, there.p, there.n)
    chosen = np.array(front)
    point, normal, weight = np.array(there.p).T[chosen], np.array(there.n).T[chosen], np.array(area)[chosen]
    counts = np.array(grid.counts) + 1
    node = np.rint((point - low) / side).astype(np.int64)
    inside = ((node >= 0) & (node < counts)).all(axis=1)
    node, normal, weight = node[inside], normal[inside], weight[inside] / side**2
    flat = np.ravel_multi_index(node.T, counts) if len(node) else np.zeros(0, dtype=np.int64)
    parts = weight * np.maximum(np.array(AXES) @ normal.T, 0)
    sums = [np.bincount(flat, part, minlength=int(counts.prod())) for part in parts]
    return np.stack(sums, axis=-1).reshape(*counts, len(AXES)).astype(np.float32)


def passing(grid: Grid, cover: NDArray[Any]) -> NDArray[np.float32]:
    """(6, cells): shares of light that come through into each cell, for each direction of travel, `AXES`.

    What lies on the face that two cells share, the mean of its four corners, blocks what comes towards it. All five rays
    of a step go through that face and are blocked alike: what one of them meets behind it, such as the wall beside the
    next cell, is what it is on its way to.

    cover: of `covered`.
    """
    shares = []
    for number, travel in enumerate(AXES):
        axis = number // 2
        near = cover[..., AXES.index(tuple(-t + 0.0 for t in travel))]
        for other in range(3):
            before, after = (np.delete(near, place, axis=other) for place in (-1, 0))
            # Across the way, the mean; along it, the face through which light comes in.
            entered = before if travel[axis] > 0 else after
            near = entered if other == axis else 0.5 * (before + after)
        shares.append(1 - np.clip(near, 0, 1).transpose(2, 1, 0).ravel())  # x runs fastest
    return np.array(shares, dtype=np.float32)
