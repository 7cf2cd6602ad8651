"""Washbasins: on a pedestal, on a cabinet, or a bowl on a board."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.cabinets import cabinet, door_pair
from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import EMBED, HANDLES, grid_panels
from gibench.generators.furniture.taps import tap
from gibench.generators.parts import FloatArray, Furniture, Mesh, Part, Support
from gibench.generators.shapes import (
    boxes,
    cylinder,
    fillet,
    loft,
    merge,
    revolve,
    rounded_rectangle,
    stacked,
    superellipse,
    translate,
)

SIZES = {
    "width": Size(0.65, 0.50, 1.00, 0.12),
    "depth": Size(0.48, 0.42, 0.56, 0.05),
    "rim": Size(0.85, 0.80, 0.90, 0.02),
}
CHOICES = {
    "style": ("pedestal", "cabinet", "bowl"),
    "finish": ("wood", "lacquer", "lacquer"),
    "handle": tuple(HANDLES),
}


def washbasin(*, width: float, depth: float, rim: float, style: str, finish: str, handle: str) -> Furniture:
    """A washbasin with its rim `rim` m above the floor and a tap behind it, which stands higher.

    finish, handle: slot and grips of the cabinet. Raises FurnitureError for a size out of SIZES or an
    option out of CHOICES.
    """
    parameters = checked("washbasin", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    if style == "pedestal":
        parts = [
            Part(_basin(w, d, rim, 0.18, 0.07), "ceramic"),
            Part(_pedestal(rim - 0.15, -0.1 * depth), "ceramic"),
        ]
        parts += _fittings(d, rim, rim - 0.125)
        return Furniture("washbasin", parameters, tuple(parts))
    low = 0.25
    if style == "cabinet":
        under = rim - 0.06
        parts = [Part(_basin(w, d, rim, 0.065, 0.02), "ceramic")]
        # The cabinet stays below the hollow; an apron closes the gap behind the fronts.
        parts += _cabinet(w, d, low, under, rim - 0.15, finish, handle)
        parts += _fittings(d, rim, rim - 0.125)
        return Furniture(
            "washbasin", parameters, tuple(parts), (Support(-w + 0.03, -w + 0.09, -d + 0.03, -d + 0.1, rim),)
        )
    board = rim - 0.14
    parts = [Part(boxes([-w, w, -d, d, board - 0.03, board], bevel=0.003), "stone")]
    parts += _cabinet(w, d, low, board - 0.029, board - 0.028, finish, handle)
    radius = min(0.21, d - 0.04, 0.8 * w)
    line = [
        [0, board - 0.001],
        [0.5 * radius, board - 0.001],
        [0.88 * radius, 0.5 * (rim + board)],
        [radius, rim],
        [radius - 0.01, rim],
        [0.86 * radius, 0.5 * (rim + board) + 0.01],
        [0.46 * radius, board + 0.016],
        [0, board + 0.012],
    ]
    bowl = revolve(fillet(line, [0, 0.03, 0.15, 0.004, 0.004, 0.15, 0.05, 0], segments=4), segments=40)
    parts.append(Part(translate(bowl, [0, d - radius - 0.02, 0]), "ceramic"))
    drain = cylinder(0.022, board + 0.01, board + 0.016, bevel=0.001, centre=(0, d - radius - 0.02))
    spout = tap(rim - board + 0.14, 0.15, at=(0, -d + 0.05, board), gooseneck=True)
    parts.append(Part(merge([drain, spout]), "chrome"))
    supports: tuple[Support, ...] = ()
    if w - radius > 0.1:
        supports = (Support(radius + 0.02, w - 0.03, -d + 0.04, d - 0.05, board),)
    return Furniture("washbasin", parameters, tuple(parts), supports)


def _basin(w: float, d: float, rim: float, thick: float, corner: float) -> Mesh:
    """A ceramic slab with a hollow: `thick` deep at its edge, below that a belly that holds the hollow."""
    back, side = 0.12, 0.05
    x0, x1, y0, y1 = -w + side, w - side, -d + back, d - side
    reach = min(0.3, w - side)
    x0, x1 = max(x0, -reach), min(x1, reach)

    def hollow(inset: float) -> FloatArray:
        return rounded_rectangle(x0 + inset, x1 - inset, y0 + inset, y1 - inset, 0.09, segments=6)

    def outer(inset: float) -> FloatArray:
        return rounded_rectangle(-w + inset, w - inset, -d + inset, d - inset, corner, segments=6)

    outlines: list[FloatArray] = []
    heights: list[float] = []
    if thick > 0.1:
        turn = np.linspace(np.pi / 2, 0, 7)
        belly = [(outer(0.145 - 0.14 * float(np.cos(t))), -0.05 - 0.15 * float(np.sin(t))) for t in turn]
        rows = [(outer(0.16), -0.2), *belly]
    else:
        rows = [(hollow(0.1), -0.14), (hollow(0.05), -0.14), (hollow(-0.008), -0.06), (outer(0.0), -0.06)]
    rows += [
        (outer(0.0), -0.04 if thick > 0.1 else -0.058),
        (outer(0.0), -0.008),
        (outer(0.008), 0.0),
        (hollow(-0.008), 0.0),
    ]
    rows += [
        (hollow(0.0), -0.008),
        (hollow(0.003), -0.018),
        (hollow(0.02), -0.07),
        (hollow(0.05), -0.115),
        (hollow(0.09), -0.125),
        (hollow(0.1), -0.125),
    ]
    for outline, z in rows:
        outlines.append(outline)
        heights.append(rim + z)
    return stacked(outlines, heights)


def _pedestal(top: float, y: float) -> Mesh:
    rows = [
        [0, 0, 0, y, 0],
        [1, 1, 0, y, 0],
        [1, 1, 0, y, 0.02],
        [0.68, 0.68, 0, y, 0.25 * top],
        [0.66, 0.66, 0, y, 0.6 * top],
        [1.0, 1.0, 0, y, top],
        [0, 0, 0, y, top],
    ]
    return loft(superellipse(0.11, 0.1, 2.6, 32), rows)


def _fittings(d: float, rim: float, floor: float) -> list[Part]:
    drain = cylinder(0.022, floor - 0.002, floor + 0.003, bevel=0.001, centre=(0, 0.035))
    spout = tap(0.15, 0.13, at=(0, -d + 0.06, rim), gooseneck=False)
    return [Part(merge([drain, spout]), "chrome")]


def _cabinet(
    w: float, d: float, low: float, under: float, body_top: float, finish: str, handle: str
) -> list[Part]:
    x = w - 0.012
    front = d - 0.006 if HANDLES[handle] == 0 else d
    face = front - HANDLES[handle]
    panels = grid_panels(-x, x, low, under - 0.003, 1 if w < 0.28 else 2, 1)
    opening = door_pair(panels)
    parts = cabinet((-x, x, -d + 0.01, front, low, body_top), opening, handle=handle, finish=finish, grip=0.9)
    feet = [
        [s * (x - 0.05) - 0.02, s * (x - 0.05) + 0.02, y - 0.02, y + 0.02, 0, low + EMBED]
        for s in (-1, 1)
        for y in (-d + 0.06, face - 0.08)
    ]
    parts.append(Part(boxes(feet, bevel=0.003), finish, "feet"))
    if body_top < under - 0.02:
        sides = [
            [s, s + 0.016, -d + 0.011, face - 0.021, body_top - 0.01, under + EMBED]
            for s in (-x + 0.001, x - 0.017)
        ]
        sides.append([-x + 0.01, x - 0.01, -d + 0.012, -d + 0.025, body_top - 0.011, under + 0.001])
        parts.append(Part(boxes(sides, bevel=0.001), finish))
    return parts


def sample_washbasin(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A washbasin with the parameters that are not fixed drawn at random."""
    return washbasin(**(draw(rng, SIZES, CHOICES) | fixed))
