"""A scene that nobody planned, looked at with rays: where in it a camera may stand, and what there is to look at."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from gibench.generators.cameras import HEIGHTS, ViewSpace
from gibench.generators.imported.errors import NoPlaceForCamera
from gibench.generators.parts import FloatArray
from gibench.rendering.free_space import enclosed, fan, seen_from, surroundings
from gibench.rendering.scene import Scene

CELL = 0.1
"""Side of the squares that the free floor is made of, m."""

MOST_CELLS = 40_000
"""Of these squares; in a larger hall they are larger."""

CLEARANCE = 0.3
"""Least distance of a camera's place to anything, m."""

EYES = (HEIGHTS[0], sum(HEIGHTS) / 2, HEIGHTS[1])
"""Heights above the floor at which a place must be free, m."""

STEP = 0.25
"""Height of a rug or a step that one may stand on, m."""

LEAST_FREE = 0.5
"""Free floor in one piece below which no camera is put there, m²."""

SHELL_SPAN = 0.6
"""Of the room, along two axes: a shape that spans so much is a part of the shell."""

LOOKOUTS = 128
SIDES = 6


class SceneCaster:
    """Casts rays at a loaded scene. The sides of a shape of the shell are owners of their own, as walls are."""

    def __init__(self, scene: Scene, shell: NDArray[np.bool_]) -> None:
        """shell: (shapes,), by shape id − 1."""
        self._scene = scene
        self._shell_number = np.where(shell, np.cumsum(shell) - 1, -1)
        self._thing_number = np.cumsum(~shell) - 1
        self.shell_owners = SIDES * int(shell.sum())

    def cast(
        self, origins: FloatArray, directions: FloatArray
    ) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """As `visibility.RayCaster.cast`."""
        distance, shape, _, normal = hits(self._scene, origins, directions)
        side = np.abs(normal).argmax(axis=1)
        side = 2 * side + (np.take_along_axis(normal, side[:, None], axis=1)[:, 0] > 0)
        row = np.maximum(shape - 1, 0)
        of_shell = SIDES * self._shell_number[row] + side
        owner = np.where(self._shell_number[row] >= 0, of_shell, self.shell_owners + self._thing_number[row])
        return distance, np.where(shape > 0, owner, -1)


def hits(scene: Scene, origins: FloatArray, directions: FloatArray) -> tuple[Any, Any, Any, Any]:
    """Distance (inf on a miss), shape id (0 on a miss), face and geometric normal of what rays (N, 3) meet."""
    ray = mi.Ray3f(
        mi.Point3f(np.ascontiguousarray(np.transpose(origins), dtype=np.float32)),
        mi.Vector3f(np.ascontiguousarray(np.transpose(directions), dtype=np.float32)),
    )
    si = scene.mi_scene.ray_intersect(ray, mi.RayFlags.Minimal, False)
    shape = scene.shape_ids(si.shape, si.is_valid())
    dr.eval(si.t, si.n, si.prim_index, shape)
    face = np.array(si.prim_index).astype(np.int64)
    return np.array(si.t), np.array(shape).astype(np.int64), face, np.array(si.n).T


def survey(scene: Scene, found: FloatArray) -> ViewSpace:
    """Find the floor, where on it a camera may stand, and what to look at. Needs a vectorised variant.

    found: (N, 3) points of the free space. Raises NoPlaceForCamera where there is no room to stand in.
    """
    floor = _floor(scene, found)
    free, height = _free_floor(scene, found, floor)
    low, high = np.percentile(found, [1, 99], axis=0)
    boxes = _boxes(scene)
    spans = np.minimum(boxes[:, 1], high) - np.maximum(boxes[:, 0], low) >= SHELL_SPAN * (high - low)
    shell = spans.sum(axis=1) >= 2
    caster = SceneCaster(scene, shell)
    middles = boxes.mean(axis=1)[~shell]
    inside = ((middles >= low) & (middles <= high)).all(axis=1)
    things = _thinned(middles[inside])
    if not len(things):
        things = np.array([(low + high) / 2])
    return ViewSpace(free, height, things, caster, caster.shell_owners, floor)


def _floor(scene: Scene, found: FloatArray) -> float:
    """Height of the floor: that below most of the free space, metres."""
    down = fan(scene, found, np.array([[0.0, 0.0, -1.0]]))[0][:, 0]
    heights = found[:, 2] - down
    heights = heights[np.isfinite(heights)]
    # Half a step is as fine as it matters; each height votes for the window around it.
    order = np.sort(heights)
    votes = np.searchsorted(order, order + STEP / 2) - np.searchsorted(order, order - STEP / 2)
    best = order[int(np.argmax(votes))]
    return float(np.median(order[np.abs(order - best) <= STEP / 2]))


def _free_floor(scene: Scene, found: FloatArray, floor: float) -> tuple[shapely.Geometry, float]:
    """The polygon of the ground where a camera may stand, and the height of the room above it, metres."""
    low, high = found[:, :2].min(axis=0), found[:, :2].max(axis=0)
    cell = max(CELL, float(np.sqrt(np.prod(high - low) / MOST_CELLS)))
    counts = np.maximum(np.ceil((high - low) / cell), 1).astype(int)
    columns, rows = (low[k] + (np.arange(counts[k]) + 0.5) * cell for k in (0, 1))
    x, y = (grid.ravel() for grid in np.meshgrid(columns, rows, indexing="ij"))
    free = np.ones(len(x), dtype=bool)
    lookouts = found[np.random.default_rng(1).permutation(len(found))[:LOOKOUTS]]
    above = np.zeros(0)
    for eye in EYES:
        places = np.flatnonzero(free)
        points = np.column_stack([x[places], y[places], np.full(len(places), floor + eye)])
        if not len(points):
            break
        reach = fan(scene, points, np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]))[0]
        good = np.abs(reach[:, 0] - eye) <= STEP
        good[good] &= enclosed(scene, points[good])
        if good.any():
            is_free, near = surroundings(scene, points[good])
            good[good] &= is_free & (near >= CLEARANCE)
        if good.any():
            good[good] &= seen_from(scene, points[good], lookouts)
        free[places[~good]] = False
        above = reach[good].sum(axis=1)
    pieces, _ = ndimage.label(free.reshape(counts))
    area = np.bincount(pieces.ravel()) * cell**2
    standing = free & (area[pieces.ravel()] >= LEAST_FREE)
    if not standing.any():
        raise NoPlaceForCamera(
            f"no place for a camera: above the floor at {floor:.2f} m there is no free place of {LEAST_FREE} m²; is "
            "--scale right? Or give cameras with --cameras"
        )
    # Joined where corners are whole numbers, or rounding would leave gaps between squares.
    column, row = np.divmod(np.flatnonzero(standing), counts[1])
    squares = shapely.union_all(shapely.box(column, row, column + 1, row + 1))
    free_floor = shapely.transform(squares, lambda corners: low + corners * cell)
    height = float(np.median(above))
    return free_floor, height if np.isfinite(height) else 10.0


def _boxes(scene: Scene) -> FloatArray:
    """(shapes, 2, 3) bounding boxes by shape id − 1, metres."""
    boxes = np.zeros((len(scene.shapes), 2, 3))
    for shape in scene.mi_scene.shapes():
        number = int(scene.shape_ids(mi.ShapePtr(shape), dr.full(mi.Bool, True))[0]) - 1
        box = shape.bbox()
        boxes[number] = np.array(box.min).ravel(), np.array(box.max).ravel()
    return boxes


def _thinned(points: FloatArray, spacing: float = 0.5) -> FloatArray:
    """One of the points (N, 3) in each cube: a chandelier of a hundred meshes is looked at no more than a chair."""
    if not len(points):
        return points
    keys = np.floor(points / spacing).astype(np.int64)
    return points[np.sort(np.unique(keys, axis=0, return_index=True)[1])]
