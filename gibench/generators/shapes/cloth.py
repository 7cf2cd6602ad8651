"""Thin things: cloth and other sheets with a thickness, and leaves."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gibench.generators.parts import FloatArray, Mesh
from gibench.generators.shapes.affine import cross, smooth_normals
from gibench.generators.shapes.errors import ShapeError


def grid_normals(points: FloatArray) -> FloatArray:
    """(M, N, 3) unit normals of a grid of points (M, N, 3), towards first axis × second axis."""
    first = np.gradient(points, axis=0)
    second = np.gradient(points, axis=1)
    normals = cross(first, second)
    return normals / np.linalg.norm(normals, axis=2, keepdims=True)


def sheet(points: ArrayLike, thickness: float) -> Mesh:
    """A sheet of even thickness (m) whose middle runs through a grid of points.

    points: (M, N, 3) m, M, N ≥ 2. The sheet is smooth on both sides and has flat edges. u runs along the
    first axis of the grid, v along the second, as lengths along the middle of the grid. 4 · (M - 1) · (N -
    1) triangles and the edges. Raises ShapeError for a thickness ≤ 0 or a grid that is too small.
    """
    points = np.asarray(points, float)
    if points.ndim != 3 or min(points.shape[:2]) < 2 or not thickness > 0:
        raise ShapeError(
            f"sheet: needs a grid (≥ 2, ≥ 2, 3) and a thickness > 0; got {points.shape}, {thickness:g}"
        )
    rows, columns = points.shape[:2]
    normals = grid_normals(points)
    over, under = points + normals * (thickness / 2), points - normals * (thickness / 2)
    u_steps = np.linalg.norm(np.diff(points, axis=0), axis=2).mean(1)
    v_steps = np.linalg.norm(np.diff(points, axis=1), axis=2).mean(0)
    u, v = (np.concatenate([[0.0], np.cumsum(steps)]) for steps in (u_steps, v_steps))
    uv = np.stack(np.broadcast_arrays(u[:, None], v[None]), -1)
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    above = np.stack([a, b, c, a, c, d], -1).reshape(-1, 3)
    rim = np.concatenate([index[:, 0], index[-1, 1:], index[-2::-1, -1], index[0, -2:0:-1]])
    ahead = np.roll(rim, -1)
    flat_over, flat_under, flat_normals = over.reshape(-1, 3), under.reshape(-1, 3), normals.reshape(-1, 3)
    edge = np.stack([flat_over[rim], flat_under[rim], flat_under[ahead], flat_over[ahead]], 1)
    outward = cross(edge[:, 1] - edge[:, 0], edge[:, 3] - edge[:, 0])
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    lengths = np.linalg.norm(points.reshape(-1, 3)[ahead] - points.reshape(-1, 3)[rim], axis=1)
    stops = np.concatenate([[0.0], np.cumsum(lengths)])
    edge_uv = np.zeros((len(rim), 4, 2))
    edge_uv[:, :2, 0], edge_uv[:, 2:, 0] = stops[:-1, None], stops[1:, None]
    edge_uv[:, 1:3, 1] = -thickness
    size = rows * columns
    quad = 2 * size + 4 * np.arange(len(rim))[:, None]
    edges = np.concatenate([quad + np.array([0, 1, 2]), quad + np.array([0, 2, 3])])
    return Mesh(
        np.concatenate([flat_over, flat_under, edge.reshape(-1, 3)]),
        np.concatenate([above, above[:, ::-1] + size, edges]).astype(np.int32),
        np.concatenate([flat_normals, -flat_normals, np.repeat(outward, 4, 0)]),
        np.concatenate([uv.reshape(-1, 2), uv.reshape(-1, 2) * [1, -1], edge_uv.reshape(-1, 2)]),
    )


def leaf(
    length: float,
    width: float,
    *,
    droop: float = 0.3,
    fold: float = 0.15,
    thickness: float = 0.0015,
    widest: float = 0.4,
    cells: int = 6,
) -> Mesh:
    """A leaf that grows from the origin along +x with its upper side towards +z.

    length, width, thickness: m. droop: how far the tip hangs down, as a share of the length. fold: how far
    the edges stand above the midrib, as a share of the width. widest: where along the length it is widest,
    in (0, 1). It is thickest along the midrib and sharp at its edges. 8 · cells - 8 triangles. u runs along
    the midrib. Raises ShapeError for a size ≤ 0.
    """
    if not min(length, width, thickness) > 0:
        raise ShapeError(f"leaf: the sizes must be positive; got {length:g}, {width:g}, {thickness:g}")
    t = np.linspace(0, 1, cells + 1)
    power = np.log(0.5) / np.log(widest)
    half = width / 2 * np.sin(np.pi * t**power) ** 0.8
    half[[0, -1]] = 0
    x = length * t * (1 - 0.15 * droop * t)
    z = -length * droop * t**2
    rib = np.stack([x, np.zeros_like(x), z], 1)
    left = np.stack([x, half, z + 2 * fold * half], 1)
    right = left * [1, -1, 1]
    lift = np.zeros((cells + 1, 3))
    lift[1:-1, 2] = thickness / 2
    # One side of the leaf: three lines of points; the outer ones and the tips are shared by both sides.
    sides = [np.stack([right, rib + lift, left], 1), np.stack([right, rib - lift, left], 1)]
    index = np.arange(3 * (cells + 1)).reshape(cells + 1, 3)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    triangles = np.stack([a, b, c, a, c, d], -1).reshape(-1, 3)
    corner = sides[0].reshape(-1, 3)[triangles]
    area = np.linalg.norm(cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    triangles = triangles[area > 1e-12]
    points = [side.reshape(-1, 3) for side in sides]
    normals = [smooth_normals(points[0], triangles), smooth_normals(points[1], triangles[:, ::-1])]
    uv = np.stack([np.broadcast_to(length * t[:, None], (cells + 1, 3)), sides[0][..., 1]], -1).reshape(-1, 2)
    # The tips stand three times; only the middle one of each is used.
    used = np.unique(triangles)
    number = np.zeros(index.size, np.int32)
    number[used] = np.arange(len(used))
    faces = number[triangles]
    return Mesh(
        np.concatenate([p[used] for p in points]),
        np.concatenate([faces, faces[:, ::-1] + len(used)]).astype(np.int32),
        np.concatenate([n[used] for n in normals]),
        np.concatenate([uv[used], uv[used] * [1, -1]]),
    )
