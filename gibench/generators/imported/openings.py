"""Openings by which daylight enters an imported scene: found from rays that leave it, and used as portals.

A portal that is too large costs some samples, one that is missed some noise; neither costs a bias
(`gibench.rendering.portals`).
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gibench.generators.parts import FloatArray
from gibench.rendering.free_space import fan, sphere
from gibench.rendering.scene import Scene

POINTS, RAYS = 512, 512
CELL = 0.1
"""Side of the squares on the walls of the free space that escaping rays are counted in, m."""

MOST_CELLS = 512
"""Along either side of a wall."""

LEAST_RAYS = 16
"""Through an opening; a crack is none."""

RIM = 0.1
"""Of the rays through the busiest tenth of a wall's squares: squares with fewer are left out."""


def find_openings(scene: Scene, found: FloatArray) -> FloatArray:
    """(N, 3, 3) rectangles (corner and two edges, whose cross product points inside, metres).

    scene: with an environment; without one there are none. found: (M, 3) points of its free space.
    """
    if scene.mi_scene.environment() is None:
        return np.zeros((0, 3, 3))
    points = found[np.random.default_rng(3).permutation(len(found))[:POINTS]]
    directions = sphere(RAYS)
    away = ~np.isfinite(fan(scene, points, directions)[0])
    which, where = np.nonzero(away)
    origins, rays = points[which], directions[where]
    low, high = found.min(axis=0) - CELL / 2, found.max(axis=0) + CELL / 2
    # The side of the box that each ray leaves by.
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(rays > 0, (high - origins) / rays, (low - origins) / rays)
    reach = np.where(np.abs(rays) > 1e-9, reach, np.inf)
    axis = reach.argmin(axis=1)
    exits = origins + reach.min(axis=1)[:, None] * rays
    positive = np.take_along_axis(rays, axis[:, None], axis=1)[:, 0] > 0
    rectangles: list[FloatArray] = []
    for side, is_high in itertools.product(range(3), (False, True)):
        through = exits[(axis == side) & (positive == is_high)]
        rectangles += _on_side(through, low, high, side, is_high)
    return np.array(rectangles).reshape(-1, 3, 3)


def _on_side(
    exits: FloatArray, low: FloatArray, high: FloatArray, side: int, is_high: bool
) -> list[FloatArray]:
    """Rectangles around the clusters of points (N, 3) on one side of a box."""
    u, v = (side + 1) % 3, (side + 2) % 3
    extent = (high - low)[[u, v]]
    cell = max(CELL, float(extent.max()) / MOST_CELLS)
    shape = tuple(np.maximum(np.ceil(extent / cell), 1).astype(int))
    place = np.floor((exits[:, [u, v]] - low[[u, v]]) / cell).astype(int)
    place = np.clip(place, 0, np.array(shape) - 1)
    counts: NDArray[np.int64] = np.zeros(shape, dtype=np.int64)
    np.add.at(counts, tuple(place.T), 1)
    # What few rays graze, at the rim, would double the area for next to no light.
    busy = counts > RIM * np.percentile(counts[counts > 0], 90) if counts.any() else counts > 0
    # Rays are sparse: what nearly touches is one opening.
    labels, _ = ndimage.label(ndimage.binary_closing(np.pad(busy, 2), np.ones((3, 3)))[2:-2, 2:-2])
    rectangles = []
    for number, found in enumerate(ndimage.find_objects(labels), 1):
        if counts[found][labels[found] == number].sum() < LEAST_RAYS:
            continue
        corner = np.zeros(3)
        corner[side] = (high if is_high else low)[side]
        edges = np.zeros((2, 3))
        for edge, (span, k) in zip(edges, zip(found, (u, v), strict=True), strict=True):
            corner[k] = low[k] + span.start * cell
            edge[k] = (span.stop - span.start) * cell
        # u × v points along +side.
        rectangles.append(np.array([corner, edges[1], edges[0]] if is_high else [corner, edges[0], edges[1]]))
    return rectangles
