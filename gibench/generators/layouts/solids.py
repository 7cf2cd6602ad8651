"""Boxes that stand for furniture while it is being placed.

A set of boxes is an array (N, 7): centre x and y, half lengths along the box's own x and y, yaw, lowest and
highest z; metres and radians. They contain the meshes they stand for, so what is free for them is free.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gibench.generators.parts import FloatArray, Furniture, IntArray
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
        vertices = part.mesh.vertices
        starts = _component_starts(vertices, part.mesh.faces)
        lows.append(np.minimum.reduceat(vertices, starts))
        highs.append(np.maximum.reduceat(vertices, starts))
    return _boxes(np.concatenate(lows), np.concatenate(highs))


def _component_starts(vertices: FloatArray, faces: IntArray) -> NDArray[np.intp]:
    """The first vertex of every closed surface, for surfaces whose vertices follow each other, as merging leaves them.

    Surfaces that are interleaved count as one.
    """
    # Corners are split where normals jump: those at the same place belong together like those of a triangle.
    cells = np.round(vertices * MERGED).astype(np.int64) @ np.array([1, 1 << 21, 1 << 42])
    order = np.argsort(cells)
    twins = np.flatnonzero(cells[order[1:]] == cells[order[:-1]])
    one, other = order[twins], order[twins + 1]
    first = np.concatenate([faces.min(1), np.minimum(one, other)])
    last = np.concatenate([faces.max(1), np.maximum(one, other)])
    # A surface starts where no link passes over.
    size = len(vertices) + 1
    passing = np.cumsum(np.bincount(first + 1, minlength=size) - np.bincount(last + 1, minlength=size))
    return np.flatnonzero(passing[:-1] == 0)


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
    if len(b) == 0:
        return False
    x, y, half_x, half_y, _, bottom, top = a.T
    reach = np.hypot(half_x, half_y)
    other_x, other_y, other_half_x, other_half_y, _, other_bottom, other_top = b.T
    near = (other_bottom < top.max()) & (other_top > bottom.min())
    other_reach = np.hypot(other_half_x, other_half_y)
    near &= (other_x + other_reach > (x - reach).min()) & (other_x - other_reach < (x + reach).max())
    near &= (other_y + other_reach > (y - reach).min()) & (other_y - other_reach < (y + reach).max())
    return bool(near.any()) and bool(overlap(a, b[near]).any())


def rectangle(
    x: float, y: float, half_x: float, half_y: float, yaw: float, z0: float, z1: float
) -> FloatArray:
    """(1, 7) one box."""
    return np.array([[x, y, half_x, half_y, yaw, z0, z1]])


# The corners of a box are its ground corners, counter-clockwise, at the bottom and then at the top.
_BOX_FACES = np.array(
    [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]]
    + [t for a, b in ((0, 1), (1, 2), (2, 3), (3, 0)) for t in ([a, b, b + 4], [a, b + 4, a + 4])],
    np.int32,
)


def triangles(boxes: FloatArray) -> tuple[FloatArray, IntArray]:
    """The boxes as one surface: vertices (8 N, 3) and faces (12 N, 3), counter-clockwise seen from outside."""
    vertices = np.empty((len(boxes), 2, 4, 3))
    vertices[..., :2] = corners(boxes)[:, None]
    vertices[..., 2] = boxes[:, 5:, None]
    starts = 8 * np.arange(len(boxes), dtype=np.int32)
    return vertices.reshape(-1, 3), (_BOX_FACES + starts[:, None, None]).reshape(-1, 3)
