"""Kitchen wall cupboards and open wall units."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.cabinets import cabinet, door_pair
from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import HANDLES, grid_panels
from gibench.generators.parts import Furniture, Part, Support
from gibench.generators.shapes import boxes

SIZES = {
    "width": Size(1.20, 0.40, 3.60, 0.3),
    "depth": Size(0.35, 0.28, 0.40, 0.05),
    "height": Size(0.70, 0.35, 0.95, 0.08),
}
CHOICES = {
    "style": ("doors", "doors", "open"),
    "finish": ("wood", "lacquer", "lacquer"),
    "handle": tuple(HANDLES),
}


def wall_cupboard(
    *, width: float, depth: float, height: float, style: str, finish: str, handle: str
) -> Furniture:
    """A cupboard that hangs on a wall (m). finish: slot of its boards; handle: of its doors.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("wall_cupboard", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    doors = max(1, round(width / 0.5))
    if style == "doors":
        opening = door_pair(grid_panels(-w, w, 0, height, doors, 1))
        parts = cabinet((-w, w, -d, d, 0, height), opening, handle=handle, finish=finish, grip=0.0)
        return Furniture("wall_cupboard", parameters, tuple(parts), mount="wall")
    side = 0.018
    boards = [[s, s + side, -d, d, 0, height] for s in (-w, w - side)]
    boards.append([-w + 0.01, w - 0.01, -d + 0.001, -d + 0.009, 0.003, height - 0.003])
    supports = []
    for k, z in enumerate(np.linspace(side + 0.001, height - 0.001, 3)):
        boards.append([-w + 0.015, w - 0.015, -d + 0.004, d - 0.003, z - side, z])
        if k < 2:
            room = (height - 0.002 - side) / 2 - side - 0.01
            supports.append(Support(-w + 0.04, w - 0.04, -d + 0.03, d - 0.03, float(z), room))
    part = Part(boxes(boards, bevel=0.0015), finish)
    return Furniture("wall_cupboard", parameters, (part,), tuple(supports), mount="wall")


def sample_wall_cupboard(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A wall cupboard with the parameters that are not fixed drawn at random."""
    return wall_cupboard(**(draw(rng, SIZES, CHOICES) | fixed))
