"""Wardrobes: hinged doors, doors over drawers, or sliding doors, one of them a mirror."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.cabinets import cabinet, door_pair
from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import HANDLES, grid_panels
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import boxes

SIZES = {
    "width": Size(1.50, 0.80, 2.60, 0.18),
    "depth": Size(0.60, 0.50, 0.70, 0.05),
    "height": Size(2.05, 1.80, 2.25, 0.05),
}
CHOICES = {
    "style": ("doors", "drawers", "sliding"),
    "finish": ("wood", "lacquer", "lacquer"),
    "handle": tuple(HANDLES),
}


def wardrobe(*, width: float, depth: float, height: float, style: str, finish: str, handle: str) -> Furniture:
    """A wardrobe (m). finish: slot of its boards; handle: of hinged doors (sliding ones have none).

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("wardrobe", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    low, cornice = 0.07, 0.03
    if style == "sliding":
        parts = _sliding(w, d, low, height - cornice, finish)
        face = d
    else:
        face = d - HANDLES[handle]
        doors = max(2, round(width / 0.5))
        split = low + 0.4 if style == "drawers" else low
        x = w - 0.004
        opening = door_pair(grid_panels(-x, x, split, height - cornice, doors, 1))
        if style == "drawers":
            opening += [(p, "drawer") for p in grid_panels(-x, x, low, split, max(1, doors // 2), 2)]
        body = (-x, x, -d + 0.002, d, low, height - cornice + 0.002)
        parts = cabinet(body, opening, handle=handle, finish=finish, grip=0.4)
    parts.append(
        Part(
            boxes(
                [
                    -w,
                    w,
                    -d,
                    face if style == "sliding" or handle == "none" else face + 0.004,
                    height - cornice,
                    height,
                ],
                bevel=0.004,
            ),
            finish,
        )
    )
    parts.append(
        Part(boxes([-w + 0.02, w - 0.02, -d + 0.02, face - 0.07, 0, low + 0.002], bevel=0.002), finish)
    )
    return Furniture("wardrobe", parameters, tuple(parts))


def _sliding(w: float, d: float, low: float, top: float, finish: str) -> list[Part]:
    sides = [[x, x + 0.025, -d + 0.002, d - 0.003, low - 0.02, top + 0.002] for x in (-w + 0.002, w - 0.027)]
    body = [-w + 0.02, w - 0.02, -d + 0.004, d - 0.075, low, top + 0.003]
    rails = [[-w + 0.022, w - 0.022, d - 0.08, d - 0.006, z, z + 0.03] for z in (low - 0.003, top - 0.026)]
    overlap = 0.02
    back_door = [-w + 0.028, overlap, d - 0.068, d - 0.046, low + 0.024, top - 0.023]
    front_door = [-overlap, w - 0.028, d - 0.036, d - 0.016, low + 0.024, top - 0.023]
    glass = [
        front_door[0] + 0.03,
        front_door[1] - 0.03,
        d - 0.018,
        d - 0.013,
        front_door[4] + 0.03,
        front_door[5] - 0.03,
    ]
    return [
        Part(boxes([*sides, body], bevel=0.0015), finish),
        Part(boxes(rails, bevel=0.001), "metal"),
        Part(boxes(back_door, bevel=0.002), finish, "front"),
        Part(boxes(front_door, bevel=0.002), "metal"),
        Part(boxes(glass, bevel=0.001), "mirror"),
    ]


def sample_wardrobe(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A wardrobe with the parameters that are not fixed drawn at random."""
    return wardrobe(**(draw(rng, SIZES, CHOICES) | fixed))
