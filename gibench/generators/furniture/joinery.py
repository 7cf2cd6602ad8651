"""Building blocks of several families: legs, posts, fronts, handles, rows of books."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from gibench.generators.parts import Light, Mesh, Part
from gibench.generators.shapes import (
    boxes,
    cylinder,
    fillet,
    fit,
    loft,
    merge,
    repeat_at,
    revolve,
    rotate_x,
    rounded_rectangle,
    transform,
    translate,
)

EMBED = 0.002
"""Distance (m) that one part reaches into the next, so that no two faces lie in one plane."""

LEG_STYLES = ("square", "tapered", "round", "turned")


def leg(style: str, height: float, size: float) -> Mesh:
    """A furniture leg on the origin, `size` across at its top (m), of one of LEG_STYLES."""
    half = size / 2
    if style == "square":
        return boxes([-half, half, -half, half, 0, height], bevel=0.003)
    if style == "tapered":
        mesh = boxes([-half, half, -half, half, 0, height], bevel=0.003, grain=2)
        shrink = 0.55 + 0.45 * mesh.vertices[:, 2:] / height
        vertices = mesh.vertices * np.concatenate([shrink, shrink, np.ones_like(shrink)], 1)
        uvs = mesh.uvs * np.concatenate([np.ones_like(shrink), shrink], 1)
        return Mesh(vertices, mesh.faces, mesh.normals, uvs)
    if style == "round":
        return cylinder(0.32 * size, 0, height, top_radius=half, bevel=0.003, segments=16)
    profile = np.array(
        [
            [0, 0],
            [0.3, 0],
            [0.34, 0.06],
            [0.24, 0.12],
            [0.4, 0.45],
            [0.5, 0.74],
            [0.3, 0.8],
            [0.5, 0.84],
            [0.5, 1],
            [0, 1],
        ]
    )
    profile = profile * [size, height]
    return revolve(fillet(profile, [0, 0.003, *[0.3 * size] * 4, 0.003, 0.003, 0.002, 0]), segments=16)


def legs(
    style: str,
    x: float,
    y: float,
    height: float,
    size: float,
    *,
    splay: float = 0.0,
    back: float | None = None,
) -> Mesh:
    """Four legs with their tops centred on (±x, y) and (±x, back), by default (±x, ±y), from the floor to
    height.

    splay: how far (m) each foot stands further out along x and y than its top.
    """
    back = -y if back is None else back
    one = leg(style, height, size)
    meshes = []
    for sign_x, at_y, sign_y in ((-1, y, 1), (1, y, 1), (-1, back, -1), (1, back, -1)):
        meshes.append(lean(one, sign_x * splay, sign_y * splay, height, at=(sign_x * x, at_y)))
    return merge(meshes)


def lean(mesh: Mesh, x: float, y: float, height: float, *, at: tuple[float, float] = (0.0, 0.0)) -> Mesh:
    """The mesh sheared so that what is at z = height stays and what is at z = 0 moves by (x, y); then moved
    to `at`."""
    matrix = np.eye(4)
    matrix[:2, 2] = [-x / height, -y / height]
    matrix[:2, 3] = [x + at[0], y + at[1]]
    return transform(mesh, matrix)


def post(width: float, depth: float, path: ArrayLike, *, taper: float = 1.0) -> Mesh:
    """A post with level cuts, of rectangular section with eased edges, through the points of a path (K, 3) m.

    taper: size of the last section as a share of the first. Bottom and top are level.
    """
    path = np.asarray(path, float)
    scales = np.linspace(1, taper, len(path))[:, None]
    rows = np.concatenate([scales, scales, path], 1)
    ends = rows[[0, -1]] * [0, 0, 1, 1, 1]
    radius = 0.2 * min(width, depth)
    outline = rounded_rectangle(-width / 2, width / 2, -depth / 2, depth / 2, radius, segments=2)
    return loft(outline, np.concatenate([ends[:1], rows, ends[1:]]))


def upright(mesh: Mesh, depth: float) -> Mesh:
    """A flat thing made in the x-y plane, its face towards +z, stood up to face +y with its back at y =
    -depth / 2 (m)."""
    return transform(mesh, [[-1, 0, 0, 0], [0, 0, 1, -depth / 2], [0, 1, 0, 0], [0, 0, 0, 1]])


Panel = tuple[float, float, float, float]
"""(x0, x1, z0, z1) of a front (m)."""


def grid_panels(
    x0: float,
    x1: float,
    z0: float,
    z1: float,
    columns: int,
    rows: int | Sequence[float],
    *,
    gap: float = 0.003,
) -> list[Panel]:
    """Fronts that fill a rectangle, with gaps between and around them (m), row by row from the bottom.

    rows: how many of equal height, or their relative heights.
    """
    shares = np.ones(rows) if isinstance(rows, int) else np.asarray(rows, float)
    x = np.linspace(x0, x1, columns + 1)
    z = z0 + (z1 - z0) * np.concatenate([[0.0], np.cumsum(shares)]) / shares.sum()
    half = gap / 2
    return [
        (float(x[i] + half), float(x[i + 1] - half), float(z[j] + half), float(z[j + 1] - half))
        for j in range(len(shares))
        for i in range(columns)
    ]


def fronts(panels: Sequence[Panel], y: float, *, thickness: float = 0.019, bevel: float = 0.0015) -> Mesh:
    """Boards for the panels whose outer face lies at y."""
    return boxes([[a, b, y - thickness, y, c, d] for a, b, c, d in panels], bevel=bevel, grain=0)


HANDLES = {"none": 0.0, "bar": 0.03, "knob": 0.028, "cup": 0.022}
"""Kinds of handles and how far (m) each stands out from its front."""


def handles(
    kind: str, places: Sequence[tuple[float, float]], y: float, *, length: float = 0.14, upright: bool = False
) -> Mesh:
    """Handles of a kind (other than "none") centred on the places (x, z) of a front at y (m).

    length: of a bar; upright: bars stand, as on doors.
    """
    reach = HANDLES[kind]
    if kind == "knob":
        profile = fillet(
            [
                [0, -EMBED],
                [0.007, -EMBED],
                [0.006, 0.4 * reach],
                [0.014, 0.7 * reach],
                [0.012, reach],
                [0, reach],
            ],
            [0, 0, 0.004, 0.005, 0.004, 0],
        )
        one = rotate_x(revolve(profile, segments=12), -np.pi / 2)
    elif kind == "cup":
        half = min(length, 0.09) / 2
        one = boxes([-half, half, -EMBED, reach, -0.012, 0.012], bevel=0.006)
    else:
        half, post_at = length / 2, 0.38 * length
        bars = [[-half, half, reach - 0.009, reach, -0.005, 0.005]]
        bars += [[s - 0.004, s + 0.004, -EMBED, reach - 0.007, -0.004, 0.004] for s in (-post_at, post_at)]
        one = boxes(bars, bevel=0.0015)
        if upright:
            one = transform(one, np.array([[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1.0]]))
    return repeat_at(one, [[x, y, z] for x, z in places])


def book_row(
    rng: np.random.Generator, x0: float, x1: float, y_front: float, z: float, tallest: float, deepest: float
) -> list[Part]:
    """Upright books that fill a stretch of a shelf board at z, spines towards +y (m).

    Each book is a cover, of one of six variants, with the edges of its pages a hair above it.
    """
    most = int((x1 - x0) / 0.014) + 1
    thick = rng.uniform(0.014, 0.045, most)
    stops = x0 + np.cumsum(thick + 0.0012)
    keep = stops <= x1
    thick, starts = thick[keep], (stops - thick - 0.0012)[keep]
    count = len(thick)
    high = tallest * rng.uniform(0.68, 1.0, count) - 0.001
    back = -deepest * rng.uniform(0.75, 1.0, count)
    spine = y_front - rng.uniform(0.0, 0.012, count)
    kind = rng.integers(6, size=count)
    if not count:
        return []
    bottom = np.full(count, z)
    covers = np.stack([starts, starts + thick, spine + back, spine, bottom, bottom + high], 1)
    board = 0.0025
    pages = covers + np.array([board, -board, 0.002, -board, 0.5 * tallest, 0.001])
    parts = [
        Part(boxes(covers[kind == k], bevel=0.0012, grain=2), "paper", f"cover {k}") for k in np.unique(kind)
    ]
    return [*parts, Part(boxes(pages, bevel=0, grain=2), "paper", "pages")]


def fit_parts(parts: Sequence[Part], low: ArrayLike, high: ArrayLike) -> list[Part]:
    """The parts scaled and moved together so that their bounding box spans low (3,) to high (3,) m."""
    joined = merge([p.mesh for p in parts])
    moved = fit(joined, low, high)
    result, start, face = [], 0, 0
    for part in parts:
        stop, end = start + len(part.mesh.vertices), face + len(part.mesh.faces)
        mesh = Mesh(
            moved.vertices[start:stop],
            part.mesh.faces,
            moved.normals[start:stop],
            moved.uvs[start:stop],
        )
        result.append(Part(mesh, part.slot, part.variant))
        start, face = stop, end
    return result


def centred(
    parts: Sequence[Part], lights: Sequence[Light] = ()
) -> tuple[tuple[Part, ...], tuple[Light, ...]]:
    """The parts and lights moved together in x and y so that the middle of the parts' bounding box is the
    origin."""
    low = np.min([p.mesh.vertices.min(0) for p in parts], 0)
    high = np.max([p.mesh.vertices.max(0) for p in parts], 0)
    offset = -(low + high) / 2 * [1, 1, 0]
    moved = tuple(Part(translate(p.mesh, offset), p.slot, p.variant) for p in parts)
    x, y = float(offset[0]), float(offset[1])
    return moved, tuple(replace(a, centre=(a.centre[0] + x, a.centre[1] + y, a.centre[2])) for a in lights)
