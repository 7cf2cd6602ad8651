"""Low boards for a television: closed, with an open middle, or on legs."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.cabinets import cabinet, door_pair
from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import EMBED, HANDLES, grid_panels, legs
from gibench.generators.parts import Furniture, Part, Support
from gibench.generators.shapes import boxes

SIZES = {
    "width": Size(1.60, 1.10, 2.20, 0.12),
    "depth": Size(0.42, 0.34, 0.52),
    "height": Size(0.50, 0.38, 0.64),
}
CHOICES = {
    "style": ("closed", "open", "legs"),
    "finish": ("wood", "wood", "lacquer"),
    "handle": tuple(HANDLES),
}


def tv_stand(*, width: float, depth: float, height: float, style: str, finish: str, handle: str) -> Furniture:
    """A low board (m). style: open has a free compartment in its middle; finish: slot of its boards.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("tv_stand", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    low = 0.15 if style == "legs" else 0.05
    top = 0.024
    under = height - top
    face = d - HANDLES[handle]
    x = w - 0.004
    edge = d if handle == "none" else face + 0.001
    parts = [Part(boxes([-w, w, -d, edge, under, height], bevel=0.003), finish, "top")]
    supports = [Support(-w + 0.04, w - 0.04, -d + 0.03, edge - 0.03, height)]
    middle = 0.3 * width if style == "open" else 0.0
    if style == "open":
        for x0, x1, way in ((-x, -middle / 2, "right"), (middle / 2, x, "left")):
            opening = [(p, way) for p in grid_panels(x0, x1, low, under - 0.002, 1, 1)]
            parts += cabinet(
                (x0, x1, -d + 0.002, d, low, under + EMBED), opening, handle=handle, finish=finish
            )
        floor = low + 0.022
        boards = [
            [-middle / 2 - 0.01, middle / 2 + 0.01, -d + 0.004, face - 0.024, low + 0.002, floor],
            [-middle / 2 - 0.008, middle / 2 + 0.008, -d + 0.005, -d + 0.012, low + 0.01, under + EMBED / 2],
        ]
        parts.append(Part(boxes(boards, bevel=0.0015), finish))
        supports.append(
            Support(
                -middle / 2 + 0.02, middle / 2 - 0.02, -d + 0.04, face - 0.05, floor, under - floor - 0.01
            )
        )
    else:
        columns = 2 if width < 1.4 else 3
        panels = grid_panels(-x, x, low, under - 0.002, columns, 1)
        opening = door_pair(panels) if columns == 2 else [(p, "drawer") for p in panels]
        parts += cabinet((-x, x, -d + 0.002, d, low, under + EMBED), opening, handle=handle, finish=finish)
    if style == "legs":
        stand = legs("round", x - 0.1, face - 0.1, low + EMBED, 0.036, back=-d + 0.08, splay=0.03)
        parts.append(Part(stand, "wood"))
    else:
        plinth = [[-x + 0.03, x - 0.03, -d + 0.03, face - 0.06, 0, low + EMBED + 0.002]]
        parts.append(Part(boxes(plinth, bevel=0.002), finish))
    return Furniture("tv_stand", parameters, tuple(parts), tuple(supports))


def sample_tv_stand(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A low board with the parameters that are not fixed drawn at random."""
    return tv_stand(**(draw(rng, SIZES, CHOICES) | fixed))
