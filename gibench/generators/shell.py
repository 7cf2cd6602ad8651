"""The shell of a room: walls with thickness, floor and ceiling slabs, skirting, a door and windows.

The footprint is a rectangle centred on the origin, or an L: the rectangle less a notch at one corner. Walls
grow outwards from it, so that the sampled size is the size inside. Slabs reach under and over the walls, and
walls over each other at the corners, so that light enters through windows alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gibench.generators.grid_solid import grid_solid
from gibench.generators.openings import ARCHITRAVE, HAIR, Opening, door_parts, window_parts
from gibench.generators.parts import FloatArray, Mesh, Part
from gibench.generators.poses import stand

SLAB = 0.2  # thickness of floor and ceiling, m


@dataclass(frozen=True)
class Wall:
    """One wall, seen from inside: s runs along it from `start`, the room lies to its left.

    start, end: the inner corners (2,), metres, counter-clockwise around the footprint. reflex: whether the
    footprint turns inwards (270° inside) at the start and at the end.
    """

    index: int
    start: tuple[float, float]
    end: tuple[float, float]
    thickness: float
    reflex: tuple[bool, bool]

    @property
    def length(self) -> float:
        """Length inside, metres."""
        return math.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1])

    @property
    def along(self) -> FloatArray:
        """(2,) unit vector from start to end."""
        return np.subtract(self.end, self.start) / self.length

    @property
    def inward(self) -> FloatArray:
        """(2,) unit normal into the room."""
        x, y = self.along
        return np.array([-y, x])

    @property
    def yaw(self) -> float:
        """Turn of a thing whose back is to this wall, radians."""
        return math.atan2(self.along[1], self.along[0])

    def point(self, s: float, away: float) -> tuple[float, float]:
        """World xy of the point at s along the wall and `away` metres into the room."""
        x, y = np.asarray(self.start) + s * self.along + away * self.inward
        return float(x), float(y)


@dataclass(frozen=True, eq=False)
class ShellPiece:
    """A part of the shell in world space: a wall, the floor, the door …"""

    name: str
    family: str
    parts: tuple[Part, ...]


@dataclass(frozen=True, eq=False)
class Shell:
    """An empty room. footprint: (N, 2) inner corners, counter-clockwise, metres. height: clear height, metres.

    notch: (x0, y0, x1, y1) of the corner that an L-shaped footprint lacks, or None.
    """

    parameters: Mapping[str, Any]
    footprint: FloatArray
    height: float
    notch: tuple[float, float, float, float] | None
    walls: tuple[Wall, ...]
    openings: tuple[Opening, ...]
    pieces: tuple[ShellPiece, ...]

    @property
    def door(self) -> Opening:
        """The only door."""
        return next(o for o in self.openings if o.kind == "door")

    @property
    def windows(self) -> tuple[Opening, ...]:
        """The windows, in the order in which they were sampled."""
        return tuple(o for o in self.openings if o.kind == "window")

    @property
    def window_rectangles(self) -> FloatArray:
        """(N, 3, 3) corner and two edges of each window on its wall's outer face, with the room in front."""
        rectangles = []
        for window in self.windows:
            wall = self.walls[window.wall]
            x, y = wall.point(window.s0, -wall.thickness)
            along = (window.s1 - window.s0) * wall.along
            up = [0.0, 0.0, window.z1 - window.z0]
            edges = ([*along, 0.0], up)
            if np.cross(*edges) @ [*wall.inward, 0.0] < 0:
                edges = edges[::-1]
            rectangles.append([[x, y, window.z0], *edges])
        return np.array(rectangles, dtype=np.float64).reshape(-1, 3, 3)

    @property
    def skirting_depth(self) -> float:
        """Depth of the skirting in front of the wall, metres."""
        return float(self.parameters["skirting"][1])


def footprint_corners(width: float, depth: float, notch: Sequence[float] | None) -> FloatArray:
    """(4, 2) or (6, 2) corners, counter-clockwise from the south-west, metres.

    notch: (corner, width, depth) with the corner counted counter-clockwise from the south-west, or None.
    """
    x, y = width / 2, depth / 2
    corners = [(-x, -y), (x, -y), (x, y), (-x, y)]
    if notch is None:
        return np.array(corners)
    which = int(notch[0])
    cx, cy = corners[which]
    inner = (cx - math.copysign(notch[1], cx), cy - math.copysign(notch[2], cy))
    across, up = (inner[0], cy), (cx, inner[1])
    # Even corners are reached along a north-south wall, odd ones along an east-west wall.
    bend = [up, inner, across] if which % 2 == 0 else [across, inner, up]
    return np.array([*corners[:which], *bend, *corners[which + 1 :]])


def build_shell(
    *,
    width: float,
    depth: float,
    height: float,
    notch: Sequence[float] | None,
    wall_thickness: float,
    skirting: Sequence[float],
    openings: Sequence[Mapping[str, Any]],
    accent_wall: int = -1,
) -> Shell:
    """Build a shell from its sizes.

    Parameters
    ----------
    width, depth, height : inner size along x, y, z, metres.
    notch : (corner, width, depth) of the part that an L lacks (see `footprint_corners`), or None.
    wall_thickness : metres, outwards.
    skirting : (height, thickness), metres.
    openings : keyword arguments of `openings.Opening`, one of them of kind "door".
    accent_wall : index of a wall with a material of its own, -1 for none.
    """
    corners = footprint_corners(width, depth, notch)
    gap = None if notch is None else _notch_rectangle(corners, int(notch[0]), width, depth)
    walls = measured_walls(corners, wall_thickness)
    holes = tuple(Opening(**opening) for opening in openings)
    pieces = [
        ShellPiece("floor", "floor", (Part(_slab(corners, gap, (-SLAB, 0.0), wall_thickness), "floor"),)),
        ShellPiece(
            "ceiling",
            "ceiling",
            (Part(_slab(corners, gap, (height, height + SLAB), wall_thickness), "ceiling"),),
        ),
    ]
    for wall in walls:
        own = [o for o in holes if o.wall == wall.index]
        mesh = _placed(_wall_mesh(wall, height, own), wall)
        variant = "accent" if wall.index == accent_wall else ""
        pieces.append(ShellPiece(f"wall.{wall.index}", "wall", (Part(mesh, "wall", variant),)))
    runs = [mesh for wall in walls for mesh in _skirting_meshes(wall, skirting, holes)]
    pieces.append(ShellPiece("skirting", "skirting", tuple(Part(mesh, "skirting") for mesh in runs)))
    count = 0
    for hole in holes:
        wall = walls[hole.wall]
        if hole.kind == "door":
            name, parts = "door", door_parts(hole)
        else:
            name, parts = f"window.{count}", window_parts(hole, wall_thickness)
            count += 1
        placed = tuple(Part(_placed(p.mesh, wall), p.slot, p.variant) for p in parts)
        pieces.append(ShellPiece(name, hole.kind, placed))
    parameters = {
        "width": width,
        "depth": depth,
        "height": height,
        "notch": None if notch is None else list(notch),
        "wall_thickness": wall_thickness,
        "skirting": list(skirting),
        "openings": [dict(opening) for opening in openings],
        "accent_wall": accent_wall,
    }
    return Shell(parameters, corners, height, gap, walls, holes, tuple(pieces))


def _notch_rectangle(
    corners: FloatArray, which: int, width: float, depth: float
) -> tuple[float, float, float, float]:
    outer, inner = footprint_corners(width, depth, None)[which], corners[which + 1]
    low, high = np.minimum(outer, inner), np.maximum(outer, inner)
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def measured_walls(corners: FloatArray, thickness: float) -> tuple[Wall, ...]:
    """The walls around a footprint, (N, 2) corners counter-clockwise."""
    before, after = np.roll(corners, 1, 0), np.roll(corners, -1, 0)
    entering, leaving = corners - before, after - corners
    reflex = entering[:, 0] * leaving[:, 1] - entering[:, 1] * leaving[:, 0] < 0
    return tuple(
        Wall(
            i,
            (float(a[0]), float(a[1])),
            (float(b[0]), float(b[1])),
            thickness,
            (bool(reflex[i]), bool(reflex[(i + 1) % len(corners)])),
        )
        for i, (a, b) in enumerate(zip(corners, after, strict=True))
    )


def _placed(mesh: Mesh, wall: Wall) -> Mesh:
    """From the wall's frame (s along it, y into the room, z up) to the world."""
    return stand(mesh, (*wall.start, 0.0), wall.yaw)


def _wall_mesh(wall: Wall, height: float, openings: Sequence[Opening]) -> Mesh:
    """The wall in its own frame: y from −thickness to 0, with windows cut through and the door's pocket."""
    t = wall.thickness
    # At an inward corner (90° inside) a wall reaches past the next one's end; at an outward one both are
    # mitred below, since running past would show in the room.
    stop = wall.length + (0.0 if wall.reflex[1] else t)
    xs = np.unique([0.0, stop, *(s for o in openings for s in (o.s0, o.s1))])
    zs = np.unique([0.0, height, *(z for o in openings for z in (o.z0, o.z1))])
    ys = np.unique([-t, 0.0, *(-o.recess for o in openings if o.kind == "door")])
    x, y, z = np.meshgrid(*((p[:-1] + p[1:]) / 2 for p in (xs, ys, zs)), indexing="ij")
    full = np.ones(x.shape, dtype=bool)
    for o in openings:
        deep = o.recess if o.kind == "door" else t
        full &= ~((x > o.s0) & (x < o.s1) & (z > o.z0) & (z < o.z1) & (y > -deep))
    mesh = grid_solid(xs, ys, zs, full)
    vertices, normals = mesh.vertices.copy(), mesh.normals.copy()
    for at_end, at, sign in ((False, 0.0, -1.0), (True, stop, 1.0)):
        if wall.reflex[at_end]:
            cut = np.isclose(vertices[:, 0], at)
            vertices[cut, 0] += sign * vertices[cut, 1]
            face = cut & (np.abs(normals[:, 0]) > 0.5)
            normals[face] = np.array([sign, -1.0, 0.0]) / math.sqrt(2.0)
    return Mesh(vertices, mesh.faces, normals, mesh.uvs)


def _slab(
    corners: FloatArray,
    notch: tuple[float, float, float, float] | None,
    heights: tuple[float, float],
    thickness: float,
) -> Mesh:
    """The footprint grown by the wall thickness, between two heights."""
    low, high = corners.min(0), corners.max(0)
    xs, ys = [low[0] - thickness, high[0] + thickness], [low[1] - thickness, high[1] + thickness]
    full = np.ones((1, 1, 1), dtype=bool)
    if notch is not None:
        full = np.ones((2, 2, 1), dtype=bool)
        west, south = notch[0] == low[0], notch[1] == low[1]
        full[0 if west else 1, 0 if south else 1] = False
        xs.insert(1, notch[2] - thickness if west else notch[0] + thickness)
        ys.insert(1, notch[3] - thickness if south else notch[1] + thickness)
    return grid_solid(xs, ys, heights, full)


def _skirting_meshes(wall: Wall, skirting: Sequence[float], openings: Sequence[Opening]) -> list[Mesh]:
    """Closed lengths of moulding along one wall, mitred at its corners, interrupted by the door."""
    height, thickness = skirting
    # Behind the front edge the top is chamfered; the back stands a hair off the wall.
    profile = np.array(
        [
            (HAIR, 0.0),
            (thickness, 0.0),
            (thickness, height - 0.5 * thickness),
            (0.5 * thickness, height),
            (HAIR, height),
        ]
    )
    stops = [(0.0, -1.0 if wall.reflex[0] else 1.0)]
    for o in openings:
        if o.wall == wall.index and o.kind == "door":
            stops += [(o.s0 - ARCHITRAVE - HAIR, 0.0), (o.s1 + ARCHITRAVE + HAIR, 0.0)]
    stops.append((wall.length, 1.0 if wall.reflex[1] else -1.0))
    return [
        _placed(_prism(profile, start, stop), wall)
        for start, stop in zip(stops[::2], stops[1::2], strict=True)
    ]


def _prism(profile: FloatArray, start: tuple[float, float], stop: tuple[float, float]) -> Mesh:
    """A convex (y, z) profile drawn along x, both ends cut on the line x = at + slope · y."""
    n = len(profile)
    near, far = (np.column_stack([at + slope * profile[:, 0], profile]) for at, slope in (start, stop))
    follow = np.roll(np.arange(n), -1)
    edge = profile[follow] - profile
    length = np.hypot(edge[:, 0], edge[:, 1])
    # The profile runs counter-clockwise in (y, z), so outwards is to the right of each edge.
    side_normals = np.column_stack([np.zeros(n), edge[:, 1] / length, -edge[:, 0] / length])
    girth = np.concatenate([[0.0], np.cumsum(length)])
    sides = np.stack([near, near[follow], far[follow], far], 1)
    side_uvs = np.stack(
        [
            np.column_stack([p[:, 0], girth[k : n + k]])
            for p, k in zip(sides.swapaxes(0, 1), (0, 1, 1, 0), strict=True)
        ],
        1,
    )
    quads = 4 * np.arange(n)[:, None] + np.array([[0, 1, 2, 0, 2, 3]])
    fan = np.column_stack([np.zeros(n - 2, dtype=int), np.arange(1, n - 1), np.arange(2, n)])
    cap_normals = [
        sign * np.array([1.0, -slope, 0.0]) / math.hypot(1.0, slope)
        for sign, (_, slope) in ((-1.0, start), (1.0, stop))
    ]
    return Mesh(
        np.concatenate([sides.reshape(-1, 3), near, far]),
        np.concatenate([quads.reshape(-1, 3), 4 * n + fan[:, ::-1], 5 * n + fan]).astype(np.int32),
        np.concatenate([np.repeat(side_normals, 4, 0), *(np.tile(c, (n, 1)) for c in cap_normals)]),
        np.concatenate([side_uvs.reshape(-1, 2), profile, profile]),
    )
