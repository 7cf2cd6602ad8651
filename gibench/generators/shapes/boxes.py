"""Boxes with bevelled edges, rounded boxes that may swell (mattresses, seats), and pillows."""

from __future__ import annotations

from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gibench.generators.parts import FloatArray, IntArray, Mesh
from gibench.generators.shapes.affine import length, smooth_normals
from gibench.generators.shapes.errors import ShapeError

Extents = tuple[float, float, float, float, float, float]
"""(x0, x1, y0, y1, z0, z1) of a box, metres."""


@lru_cache(maxsize=2)
def _box_template(bevelled: bool) -> tuple[FloatArray, NDArray[np.bool_], FloatArray, FloatArray, IntArray]:
    """Topology of all boxes, with or without bevelled edges.

    Returns signs (96, 3) of the half-sizes, faces' normals (96, 3) (whose non-zero axis is the one that is
    not drawn in by the bevel), the UV frames (3 grains, 96, 3, 2) and the triangles (44, 3).
    """
    signs: list[FloatArray] = []
    inset: list[NDArray[np.bool_]] = []
    normals: list[FloatArray] = []
    frames: list[FloatArray] = []
    faces: list[list[int]] = []
    identity = np.eye(3)
    for facet in product((-1, 0, 1), repeat=3):
        direction = np.array(facet, float)
        axes = np.flatnonzero(direction)
        if len(axes) == 0 or (len(axes) > 1 and not bevelled):
            continue
        free = [a for a in range(3) if a not in axes]
        corners = []
        for axis in axes:
            for ends in product((-1, 1), repeat=len(free)):
                sign = direction.copy()
                sign[free] = ends
                corners.append((sign, identity[axis] == 0))
        unit = direction / np.linalg.norm(direction)
        # The vertices of a facet of this box with sides 2 and bevel 1/4, put in order around the facet.
        points = np.array([s * np.where(drawn, 0.75, 1) for s, drawn in corners])
        spread = points - points.mean(0)
        first = spread[0] / np.linalg.norm(spread[0])
        order = np.argsort(np.arctan2(spread @ np.cross(unit, first), spread @ first))
        start = len(signs)
        for k in order:
            signs.append(corners[k][0])
            inset.append(corners[k][1])
            normals.append(unit)
        faces += [[start, start + k, start + k + 1] for k in range(1, len(order) - 1)]
        facet_frames = np.empty((3, 3, 2))
        for grain in range(3):
            along = next(
                d for a in (grain, (grain + 1) % 3) if np.linalg.norm(d := identity[a] - unit * unit[a]) > 0.1
            )
            along = along / np.linalg.norm(along)
            facet_frames[grain] = np.stack([along, np.cross(unit, along)], 1)
        frames += [facet_frames] * len(order)
    return np.array(signs), np.array(inset), np.array(normals), np.stack(frames, 1), np.array(faces, np.int32)


def boxes(extents: ArrayLike, *, bevel: float = 0.002, grain: int | None = None) -> Mesh:
    """Axis-aligned boxes with bevelled edges, as one mesh.

    extents: (N, 6), each row (x0, x1, y0, y1, z0, z1) m. bevel: how far an edge is cut back (m), at most a
    quarter of the shortest side of its box; 0 for sharp edges and 12 triangles instead of 44. grain: the axis
    (0, 1, 2) that u runs along; by default the longest of each box, as boards are sawn.
    Raises ShapeError for a box without volume.
    """
    extents = np.asarray(extents, float).reshape(-1, 3, 2)
    sizes = extents[:, :, 1] - extents[:, :, 0]
    if not (np.all(np.isfinite(extents)) and np.all(sizes > 0) and bevel >= 0):
        bad = extents[int(np.argmin(sizes.min(1)))].ravel().tolist()
        raise ShapeError(
            f"boxes: sides must be positive and the bevel ({bevel:g}) not negative; got the extents {bad}"
        )
    signs, inset, normals, frames, faces = _box_template(bevel > 0)
    cut = np.minimum(bevel, sizes.min(1) / 4)
    half = sizes / 2
    reach = half[:, None] - cut[:, None, None] * inset
    vertices = extents.mean(2)[:, None] + signs * reach
    axis = sizes.argmax(1) if grain is None else np.full(len(sizes), grain)
    uvs = np.einsum("nvi,nvij->nvj", vertices, frames[axis])
    count = len(sizes)
    starts = np.arange(count, dtype=np.int32) * np.int32(len(signs))
    return Mesh(
        vertices.reshape(-1, 3),
        (faces[None] + starts[:, None, None]).reshape(-1, 3),
        np.tile(normals, (count, 1)),
        uvs.reshape(-1, 2),
    )


def box(
    x0: float,
    x1: float,
    y0: float,
    y1: float,
    z0: float,
    z1: float,
    *,
    bevel: float = 0.002,
    grain: int | None = None,
) -> Mesh:
    """One bevelled box; see `boxes`."""
    return boxes([[x0, x1, y0, y1, z0, z1]], bevel=bevel, grain=grain)


@lru_cache(maxsize=16)
def _cube_lattice(cells: int) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """The surface of a cube of cells³ cells.

    Returns the lattice points (P, 3), triangles over them (F, 3), the points of the six charts
    (6, cells + 1, cells + 1) with u along the first axis, and triangles over the charts' own vertices (F, 3).
    """
    line = np.arange(cells + 1)
    charts = []
    for axis, side in product(range(3), (0, cells)):
        # u runs along x where it can, and v = normal × u, so that charts are not mirrored.
        u_axis = 0 if axis != 0 else 1
        v_axis = 3 - axis - u_axis
        chart = np.empty((cells + 1, cells + 1, 3), int)
        chart[..., axis] = side
        chart[..., u_axis] = line[:, None]
        mirrored = np.cross(np.eye(3)[u_axis], np.eye(3)[v_axis])[axis] * (1 if side else -1) < 0
        chart[..., v_axis] = line[None, ::-1] if mirrored else line[None]
        charts.append(chart)
    every = np.array(charts)
    points, index = np.unique(every.reshape(-1, 3), axis=0, return_inverse=True)
    index = index.reshape(6, cells + 1, cells + 1)
    own = np.arange(index.size).reshape(index.shape)

    def triangles(grid: IntArray) -> IntArray:
        a, b, c, d = grid[:, :-1, :-1], grid[:, 1:, :-1], grid[:, 1:, 1:], grid[:, :-1, 1:]
        return np.stack([a, b, c, a, c, d], -1).reshape(-1, 3).astype(np.int32)

    return (
        points.astype(np.int32),
        triangles(index.astype(np.int32)),
        index.astype(np.int32),
        triangles(own.astype(np.int32)),
    )


def rounded_box(
    extents: Extents,
    radius: float,
    *,
    swell: tuple[float, float, float] = (0.0, 0.0, 0.0),
    arc: int = 3,
    flat: int = 2,
) -> Mesh:
    """A box whose edges and corners are round, with sides that may swell out like upholstery.

    extents: (x0, x1, y0, y1, z0, z1) m of the whole, swelling included. radius: of the edges (m), at most
    49 % of the shortest side. swell: by how much (m) the middle of the sides across x, y and z stands out.
    arc: segments of an eighth of a turn; flat: segments of the straight part (12 · (2 arc + flat)²
    triangles). u runs along x on all sides but ±x. Raises ShapeError for a box without volume or a radius ≤
    0.
    """
    limits = np.asarray(extents, float).reshape(3, 2)
    half = (limits[:, 1] - limits[:, 0]) / 2
    core = half - np.asarray(swell, float)
    if not (np.all(np.isfinite(limits)) and np.all(core > 0) and radius > 0):
        raise ShapeError(
            f"rounded_box: the extents {limits.ravel().tolist()} less the swelling {list(swell)} and the "
            f"radius {radius:g} must be positive"
        )
    radius = min(radius, 0.98 * float(core.min()))
    points, faces, charts, own_faces = _cube_lattice(2 * arc + flat)
    straight = core - radius
    # One coordinate along an edge: the arc as seen on the flat side (a tangent), the straight part, the arc.
    bend = radius * np.tan(np.linspace(0, np.pi / 4, arc + 1)[1:])
    ticks = np.stack(
        [np.concatenate([-s - bend[::-1], np.linspace(-s, s, flat + 1), s + bend]) for s in straight]
    )
    cube = np.stack([ticks[k][points[:, k]] for k in range(3)], 1)
    inner = np.clip(cube, -straight, straight)
    outward = cube - inner
    vertices = inner + radius * outward / length(outward)[:, None]
    if any(swell):
        bulge = 1 - (vertices / core) ** 2
        others = np.stack(
            [bulge[:, 1] * bulge[:, 2], bulge[:, 0] * bulge[:, 2], bulge[:, 0] * bulge[:, 1]], 1
        )
        vertices = vertices * (1 + np.asarray(swell) / core * others)
    low, high = vertices.min(0), vertices.max(0)
    vertices = limits[:, 0] + (vertices - low) * (2 * half / (high - low))
    normals = smooth_normals(vertices, faces)
    grid = vertices[charts]
    middle = grid.shape[1] // 2
    u = length(np.diff(grid[:, :, middle], axis=1))
    v = length(np.diff(grid[:, middle], axis=1))
    zero = np.zeros((6, 1))
    u, v = np.cumsum(np.concatenate([zero, u], 1), 1), np.cumsum(np.concatenate([zero, v], 1), 1)
    uvs = np.stack(np.broadcast_arrays(u[:, :, None], v[:, None, :]), -1)
    flat_index = charts.ravel()
    return Mesh(vertices[flat_index], own_faces, normals[flat_index], uvs.reshape(-1, 2))


def pillow(width: float, depth: float, thickness: float, *, cells: int = 12) -> Mesh:
    """A stuffed pillow around the origin: width along x, depth along y, thickness along z (m).

    Its sides curve in between the corners, as cloth does that is filled. 4 · cells² triangles.
    Raises ShapeError for a size ≤ 0.
    """
    if not min(width, depth, thickness) > 0:
        raise ShapeError(f"pillow: the sizes must be positive; got {width:g}, {depth:g}, {thickness:g}")
    line = np.sin(np.linspace(-np.pi / 2, np.pi / 2, cells + 1))
    x, y = np.meshgrid(line, line, indexing="ij")
    height = ((1 - x**2) * (1 - y**2)) ** 0.45
    top = np.stack([x * (1 - 0.08 * (1 - y**2)), y * (1 - 0.08 * (1 - x**2)), height], -1)
    size = np.array([width, depth, thickness]) / 2
    top *= size / np.abs(top).max((0, 1))
    rim = (np.abs(x) == 1) | (np.abs(y) == 1)
    top[rim, 2] = 0
    count = (cells + 1) ** 2
    upper = np.arange(count).reshape(cells + 1, cells + 1)
    lower = np.where(rim, upper, upper + count)
    a, b, c, d = (
        g.ravel() for g in np.array([upper[:-1, :-1], upper[1:, :-1], upper[1:, 1:], upper[:-1, 1:]])
    )
    a2, b2, c2, d2 = (
        g.ravel() for g in np.array([lower[:-1, :-1], lower[1:, :-1], lower[1:, 1:], lower[:-1, 1:]])
    )
    # Triangles are cut so that none has all its corners on the rim, where both sides would coincide.
    half = (cells + 1) // 2
    i, j = (g.ravel() for g in np.meshgrid(np.arange(cells), np.arange(cells), indexing="ij"))
    other = ((i < half) != (j < half))[:, None]
    over = np.where(other, np.stack([a, b, d, b, c, d], 1), np.stack([a, b, c, a, c, d], 1)).reshape(-1, 3)
    under = np.where(
        other, np.stack([a2, d2, b2, b2, d2, c2], 1), np.stack([a2, c2, b2, a2, d2, c2], 1)
    ).reshape(-1, 3)
    flat = top.reshape(-1, 3)
    points = np.concatenate([flat, flat * [1, 1, -1]])
    normals = smooth_normals(points, np.concatenate([over, under]).astype(np.int32))
    middle = (cells + 1) // 2
    u = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(top[:, middle], axis=0), axis=1))])
    v = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(top[middle], axis=0), axis=1))])
    uvs = np.stack(np.broadcast_arrays(u[:, None], v[None]), -1).reshape(-1, 2)
    lower_normals = normals[lower.ravel()]
    own_under = under.copy()
    own_under[under < count] += count
    return Mesh(
        points,
        np.concatenate([over, own_under]).astype(np.int32),
        np.concatenate([normals[:count], lower_normals]),
        np.concatenate([uvs, uvs]),
    )
