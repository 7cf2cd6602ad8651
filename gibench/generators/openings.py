"""Fillings of the holes in walls: a door with frame and handle, windows with frame and sill.

Everything is built in the frame of its wall: x along the wall, y into the room (0 on the wall's face), z up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gibench.generators.grid_solid import box, grid_solid, ring
from gibench.generators.parts import Mesh, Part

HAIR = 3e-4  # distance that keeps faces of different things from coinciding, m
ARCHITRAVE = 0.07  # width of the door frame on the wall's face, m
JAMB = 0.02  # thickness of the door frame inside the recess, m
LEAF = 0.04  # thickness of the door leaf, m
HANDLE_HEIGHT = 1.05  # m
SILL = 0.025  # thickness of the window sill, m
SILL_REACH = 0.035  # how far a sill stands out from the wall, m


@dataclass(frozen=True)
class Opening:
    """A hole in a wall, in the wall's frame, metres.

    kind: "door" (a recess that the closed leaf stands in) or "window" (cut through). It spans [s0, s1] along the
    wall and [z0, z1] in height. recess: depth of a door's recess. style: fields of the leaf as (columns, rows),
    or sashes of the window as (columns, rows). handle: the side of a door's handle, −1 at s0 and 1 at s1.
    """

    wall: int
    kind: str
    s0: float
    s1: float
    z0: float
    z1: float
    recess: float = 0.06
    style: tuple[int, int] = (1, 1)
    handle: int = 1


def door_parts(door: Opening) -> tuple[Part, ...]:
    """Frame, leaf and handle of a closed door."""
    a, b, top = door.s0, door.s1, door.z1
    xs = [a - ARCHITRAVE, a, a + JAMB, b - JAMB, b, b + ARCHITRAVE]
    full = np.zeros((5, 2, 3), dtype=bool)
    full[[1, 3], 0, :2] = full[2, 0, 1] = True
    full[[0, 1, 3, 4], 1, :] = full[2, 1, 1:] = True
    frame = grid_solid(xs, [-door.recess, HAIR, 0.018], [0.0, top - JAMB, top, top + ARCHITRAVE], full)
    front = -door.recess + HAIR + LEAF
    leaf = _leaf(door, front)
    hinge_to_handle = b - JAMB - 0.065 if door.handle > 0 else a + JAMB + 0.065
    return (
        Part(frame, "door"),
        Part(leaf, "door"),
        *(Part(mesh, "metal", "handle") for mesh in _handle(hinge_to_handle, front, -door.handle)),
    )


def _leaf(door: Opening, front: float) -> Mesh:
    """The leaf with sunk fields, thinner by a third there."""
    gap, stile = 0.003, 0.11
    x0, x1 = door.s0 + JAMB + gap, door.s1 - JAMB - gap
    z0, z1 = 0.006, door.z1 - JAMB - gap
    columns, rows = door.style
    xs, x_field = _fields(x0, x1, columns, stile)
    zs, z_field = _fields(z0, z1, rows, stile)
    full = np.ones((len(xs) - 1, 2, len(zs) - 1), dtype=bool)
    full[:, 1, :] = ~np.logical_and.outer(x_field, z_field)
    return grid_solid(xs, [front - LEAF, front - 0.012, front], zs, full)


def _fields(low: float, high: float, count: int, border: float) -> tuple[list[float], list[bool]]:
    """Planes and which intervals between them are fields, for `count` fields with borders around each."""
    if count == 0:
        return [low, high], [False]
    size = (high - low - (count + 1) * border) / count
    planes, field = [low], []
    for _ in range(count):
        planes += [planes[-1] + border, planes[-1] + border + size]
        field += [False, True]
    return [*planes, high], [*field, False]


def _handle(x: float, front: float, towards: int) -> tuple[Mesh, ...]:
    """A plate with a lever that points to the hinges; the lever reaches into the neck by construction."""
    z, y = HANDLE_HEIGHT, front + HAIR
    plate = box((x - 0.02, y, z - 0.11), (x + 0.02, y + 0.006, z + 0.04))
    far = x + 0.12 * towards
    lever = grid_solid(
        sorted([x - 0.009 * towards, x + 0.009 * towards, far]),
        [y + 0.006, y + 0.035, y + 0.05],
        [z - 0.009, z + 0.009],
        # The neck stands on the plate, the lever runs off from its end.
        np.array([[[True], [True]], [[False], [True]]])[:: 1 if towards > 0 else -1],
    )
    return plate, lever


def window_parts(window: Opening, thickness: float) -> tuple[Part, ...]:
    """Frame with its bars and the inner sill of a window in a wall of that thickness (m)."""
    inner = -thickness + 0.08
    columns, rows = window.style
    xs = list(np.linspace(window.s0, window.s1, columns + 1))
    # One horizontal bar sits high, as the transom of a fanlight does; more would be spread evenly.
    zs = [window.z0, window.z1]
    if rows == 2:
        zs.insert(1, window.z0 + 0.72 * (window.z1 - window.z0))
    frame = ring(xs, inner - 0.06, inner, zs, 0.055)
    sill = grid_solid(
        [window.s0 - 0.04, window.s0, window.s1, window.s1 + 0.04],
        [inner, HAIR, SILL_REACH],
        [window.z0, window.z0 + SILL],
        np.array([[[False], [True]], [[True], [True]], [[False], [True]]]),
    )
    return Part(frame, "window_frame"), Part(sill, "sill")
