"""Nightstands: two drawers, a drawer over an open shelf, or a drawer on legs."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.cabinets import cabinet
from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import EMBED, HANDLES, grid_panels, legs
from gibench.generators.parts import Furniture, Part, Support
from gibench.generators.shapes import boxes, cylinder

SIZES = {
    "width": Size(0.46, 0.35, 0.60),
    "depth": Size(0.40, 0.32, 0.50),
    "height": Size(0.54, 0.42, 0.68),
}
CHOICES = {
    "style": ("drawers", "open", "legs"),
    "finish": ("wood", "wood", "lacquer"),
    "handle": tuple(HANDLES),
    "metal": ("metal", "brass"),
}


def nightstand(
    *, width: float, depth: float, height: float, style: str, finish: str, handle: str, metal: str
) -> Furniture:
    """A bedside cabinet (m). style: its lower part; finish: slot of its boards; metal: slot of its handles.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("nightstand", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    top = 0.02
    under = height - top
    face = d - HANDLES[handle]
    x = w - 0.005
    low = {"drawers": 0.06, "open": under - 0.17, "legs": under - 0.19}[style]
    rows = 2 if style == "drawers" else 1
    opening = [(p, "drawer") for p in grid_panels(-x, x, low, under - 0.002, 1, rows)]
    parts = cabinet(
        (-x, x, -d + 0.002, d, low, under + EMBED), opening, handle=handle, finish=finish, metal=metal
    )
    edge = d if handle == "none" else face + 0.001
    parts.append(Part(boxes([-w, w, -d, edge, under, height], bevel=0.003), finish, "top"))
    supports = [Support(-w + 0.03, w - 0.03, -d + 0.03, edge - 0.03, height)]
    if style == "drawers":
        feet = [
            cylinder(0.02, 0, low + EMBED, top_radius=0.024, bevel=0.003, segments=16, centre=(a, b))
            for a in (-x + 0.05, x - 0.05)
            for b in (-d + 0.06, face - 0.07)
        ]
        parts += [Part(foot, "wood") for foot in feet]
    elif style == "open":
        side = 0.02
        boards = [
            [s, s + side, -d + 0.003, face - 0.021, 0, low + EMBED] for s in (-x + 0.001, x - side - 0.001)
        ]
        floor = 0.09
        boards += [
            [-x + side - 0.002, x - side + 0.002, -d + 0.004, face - 0.023, floor - 0.02, floor],
            [-x + side - 0.003, x - side + 0.003, -d + 0.005, -d + 0.013, floor - 0.01, low + EMBED / 2],
        ]
        parts.append(Part(boxes(boards, bevel=0.0015), finish))
        supports.append(Support(-x + 0.04, x - 0.04, -d + 0.04, face - 0.05, floor, low - floor - 0.01))
    else:
        stand = legs("tapered", x - 0.05, face - 0.07, low + EMBED, 0.04, back=-d + 0.05, splay=0.02)
        parts.append(Part(stand, "wood"))
    return Furniture("nightstand", parameters, tuple(parts), tuple(supports))


def sample_nightstand(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A nightstand with the parameters that are not fixed drawn at random."""
    return nightstand(**(draw(rng, SIZES, CHOICES) | fixed))
