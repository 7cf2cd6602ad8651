"""Boxes that stand for furniture while it is being placed.

A set of boxes is an array (N, 7): centre x and y, half lengths along the box's own x and y, yaw, lowest and
highest z; metres and radians. They contain the meshes they stand for, so what is free for them is free.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from gibench.generators.parts import FloatArray, Furniture
from gibench.generators.poses import turn

MERGED = 1e5  # vertices closer than 1 / MERGED metres are the same corner


@lru_cache(maxsize=256)
def bounds_of(furniture: Furniture) -> FloatArray:
    """`Furniture.bounds`, which is asked for many times while a piece looks for its place."""
    bounds = furniture.bounds()
    bounds.setflags(write=False)
    return bounds


@lru_cache(maxsize=64)
def whole_box(furniture: Furniture) -> FloatArray:
    """(1, 7) the bounding box of a piece of furniture in its own frame; not to be written to."""
    low, high = bounds_of(furniture)
    return _boxes(low[None], high[None])


@lru_cache(maxsize=64)
def component_boxes(furniture: Furniture) -> FloatArray:
    """(N, 7) a box for each closed surface of a piece: the top of a table apart from its legs; not to be written to."""
    lows, highs = [], []
    for part in furniture.parts:
        vertices, faces = part.mesh.vertices, part.mesh.faces
        # Corners are split where normals jump; merged by place, what is connected is one closed surface.
        cells = np.round(vertices * MERGED).astype(np.int64)
        _, same = np.unique(cells @ np.array([1, 1 << 21, 1 << 42]), return_inverse=True)
        links = same[faces]
        ones = np.ones(2 * len(links), dtype=np.int8)
        pairs = (np.concatenate([links[:, 0], links[:, 1]]), np.concatenate([links[:, 1], links[:, 2]]))
        graph = coo_array((ones, pairs), shape=(same.max() + 1,) * 2)
        count, label = connected_components(graph, directed=False)
        of_vertex = label[same]
        low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
        np.minimum.at(low, of_vertex, vertices)
        np.maximum.at(high, of_vertex, vertices)
        lows.append(low)
        highs.append(high)
    return _boxes(np.concatenate(lows), np.concatenate(highs))


def _boxes(low: FloatArray, high: FloatArray) -> FloatArray:
    middle, half = (low + high) / 2, (high - low) / 2
    return np.column_stack([middle[:, :2], half[:, :2], np.zeros(len(low)), low[:, 2], high[:, 2]])


def moved(boxes: FloatArray, position: tuple[float, float, float], yaw: float) -> FloatArray:
    """The boxes under a pose, like `poses.stand` does with a mesh."""
    result = boxes.copy()
    result[:, :2] = turn(boxes[:, :2], yaw) + np.asarray(position[:2])
    result[:, 4] += yaw
    result[:, 5:] += position[2]
    return result


def grown(boxes: FloatArray, margin: float) -> FloatArray:
    """The boxes with `margin` metres more on every horizontal side."""
    result = boxes.copy()
    result[:, 2:4] += margin
    return result


def corners(boxes: FloatArray) -> FloatArray:
    """(N, 4, 2) the ground corners, counter-clockwise."""
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    cos, sin = np.cos(boxes[:, 4])[:, None], np.sin(boxes[:, 4])[:, None]
    x, y = signs[:, 0] * boxes[:, 2, None], signs[:, 1] * boxes[:, 3, None]
    return np.stack([boxes[:, 0, None] + cos * x - sin * y, boxes[:, 1, None] + sin * x + cos * y], 2)


def overlap(a: FloatArray, b: FloatArray) -> NDArray[np.bool_]:
    """(len(a), len(b)) whether boxes share volume: separating axes on the ground, intervals in height."""
    if len(a) == 0 or len(b) == 0:
        return np.zeros((len(a), len(b)), dtype=bool)
    a, b = a[:, None, :], b[None, :, :]
    meets = (a[..., 5] < b[..., 6]) & (b[..., 5] < a[..., 6])
    dx, dy = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
    # How the axes of one box look from the other depends on the difference of their turns alone.
    cos, sin = np.abs(np.cos(b[..., 4] - a[..., 4])), np.abs(np.sin(b[..., 4] - a[..., 4]))
    for first, second in ((a, b), (b, a)):
        c, s = np.cos(first[..., 4]), np.sin(first[..., 4])
        meets &= np.abs(dx * c + dy * s) < first[..., 2] + second[..., 2] * cos + second[..., 3] * sin
        meets &= np.abs(dy * c - dx * s) < first[..., 3] + second[..., 2] * sin + second[..., 3] * cos
    return meets


def meets_any(a: FloatArray, b: FloatArray) -> bool:
    """Whether any box of a shares volume with any of b; fast where most of b is far away."""
    reach = np.hypot(a[:, 2], a[:, 3])
    low, high = (a[:, :2] - reach[:, None]).min(0), (a[:, :2] + reach[:, None]).max(0)
    reach = np.hypot(b[:, 2], b[:, 3])[:, None]
    near = ((b[:, :2] + reach > low) & (b[:, :2] - reach < high)).all(1)
    near &= (b[:, 5] < a[:, 6].max()) & (b[:, 6] > a[:, 5].min())
    return bool(near.any()) and bool(overlap(a, b[near]).any())


def rectangle(
    x: float, y: float, half_x: float, half_y: float, yaw: float, z0: float, z1: float
) -> FloatArray:
    """(1, 7) one box."""
    return np.array([[x, y, half_x, half_y, yaw, z0, z1]])
