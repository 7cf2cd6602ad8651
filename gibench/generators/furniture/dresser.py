"""Dressers: chests of drawers, sideboards with doors, on a plinth or on legs."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.cabinets import cabinet, door_pair
from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import EMBED, HANDLES, grid_panels, legs
from gibench.generators.parts import Furniture, Part, Support
from gibench.generators.shapes import boxes

SIZES = {
    "width": Size(1.20, 0.75, 1.80, 0.12),
    "depth": Size(0.51, 0.38, 0.62),
    "height": Size(0.97, 0.72, 1.25, 0.10),
}
CHOICES = {
    "style": ("drawers", "wide_drawers", "sideboard"),
    "base": ("plinth", "legs", "legs"),
    "finish": ("wood", "wood", "lacquer"),
    "handle": tuple(HANDLES),
    "metal": ("metal", "brass", "chrome"),
}


def dresser(
    *,
    width: float,
    depth: float,
    height: float,
    style: str,
    base: str,
    finish: str,
    handle: str,
    metal: str,
) -> Furniture:
    """A dresser (m). style: how its front is divided; finish: slot of its boards; metal: slot of its handles.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("dresser", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    low = 0.07 if base == "plinth" else 0.16
    top = 0.024
    under = height - top
    x = w - 0.006
    if style == "sideboard":
        split = under - 0.17
        opening = door_pair(grid_panels(-x, x, low, split, 2 if width < 1.3 else 4, 1))
        opening += [(panel, "drawer") for panel in grid_panels(-x, x, split, under - 0.002, 2, 1)]
    else:
        columns = 1 if style == "wide_drawers" and width < 1.3 else 2
        rows = (1.25, 1.25, 1.1, 0.9) if height > 0.85 else (1.2, 1.1, 0.9)
        opening = [(p, "drawer") for p in grid_panels(-x, x, low, under - 0.002, columns, rows)]
    parts = cabinet(
        (-x, x, -d + 0.002, d, low, under + EMBED), opening, handle=handle, finish=finish, metal=metal
    )
    face = d - HANDLES[handle]
    parts.append(
        Part(
            boxes([-w, w, -d, face + 0.001 if handle != "none" else d, under, height], bevel=0.004),
            finish,
            "top",
        )
    )
    if base == "plinth":
        plinth = [-x + 0.02, x - 0.02, -d + 0.02, face - 0.06, 0, low + EMBED]
        parts.append(Part(boxes(plinth, bevel=0.002), finish))
    else:
        stand = legs("tapered", x - 0.07, face - 0.09, low + EMBED, 0.055, back=-d + 0.07, splay=0.02)
        parts.append(Part(stand, "wood"))
    support = Support(-w + 0.04, w - 0.04, -d + 0.04, face - 0.04, height)
    return Furniture("dresser", parameters, tuple(parts), (support,))


def sample_dresser(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A dresser with the parameters that are not fixed drawn at random."""
    return dresser(**(draw(rng, SIZES, CHOICES) | fixed))
