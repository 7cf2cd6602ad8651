"""Open shelves to put things on: a wooden rack, a metal frame with boards, or cubes."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.parts import Furniture, Part, Support
from gibench.generators.shapes import boxes

SIZES = {
    "width": Size(0.91, 0.60, 1.40),
    "depth": Size(0.34, 0.26, 0.45),
    "height": Size(1.44, 0.90, 2.10, 0.12),
}
CHOICES = {
    "style": ("boards", "frame", "cubes"),
    "boards": (3, 4, 5),
    "finish": ("wood", "wood", "lacquer"),
}


def shelf(*, width: float, depth: float, height: float, style: str, boards: int, finish: str) -> Furniture:
    """An open shelf (m). boards: compartments above each other; finish: slot of the boards.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("shelf", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    thick = 0.022
    side = 0.025
    low = 0.1 if style == "frame" else 0.06
    top = height - (0.015 if style == "frame" else 0.0)
    levels = np.linspace(low, top, boards + 1)  # upper faces: of the lowest board, …, of the top one
    inner = w - side
    parts = []
    if style == "frame":
        shelves = [[-inner, inner, -d + 0.012, d - 0.012, z - thick, z] for z in levels]
        posts = [[x, x + side, y, y + side, 0, height] for x in (-w, w - side) for y in (-d, d - side)]
        posts += [
            [x + 0.003, x + side - 0.003, -d + 0.02, d - 0.02, z - thick + 0.003, z - 0.003]
            for x in (-w, w - side)
            for z in levels
        ]
        shelves = [[a - 0.004, b + 0.004, y0, y1, z0, z1] for a, b, y0, y1, z0, z1 in shelves]
        parts += [Part(boxes(shelves, bevel=0.002), finish), Part(boxes(posts, bevel=0.002), "metal")]
    else:
        boards_at = [
            [-inner - 0.003, inner + 0.003, -d + 0.006, d - 0.002, z - thick, z] for z in levels[:-1]
        ]
        boards_at.append(
            [-inner - 0.003, inner + 0.003, -d + 0.006, d - 0.002, height - thick - 0.001, height - 0.001]
        )
        boards_at += [[x, x + side, -d, d, 0, height] for x in (-w, w - side)]
        boards_at.append([-inner - 0.004, inner + 0.004, d - 0.05, d - 0.03, 0.001, low - thick + 0.002])
        if style == "cubes":
            boards_at.append([-side / 2, side / 2, -d + 0.008, d - 0.004, low - 0.003, height - 0.003])
        parts.append(Part(boxes(boards_at, bevel=0.0015), finish))
        back = boxes(
            [-inner - 0.005, inner + 0.005, -d + 0.001, -d + 0.007, low - thick / 2, height - 0.008],
            bevel=0.001,
        )
        parts.append(Part(back, finish, "back"))
    supports = []
    halves = [(-inner + 0.02, -side / 2 - 0.02), (side / 2 + 0.02, inner - 0.02)]
    columns = halves if style == "cubes" else [(-inner + 0.02, inner - 0.02)]
    for k, z in enumerate(levels):
        clearance = float(levels[k + 1] - thick - z - 0.012) if k < boards else 1.0
        edge = 0.03
        for x0, x1 in columns if k < boards else [(-inner + 0.02, inner - 0.02)]:
            surface = float(z) if k < boards or style == "frame" else height - 0.001
            supports.append(Support(x0, x1, -d + edge, d - edge, surface, clearance))
    return Furniture("shelf", parameters, tuple(parts), tuple(supports))


def sample_shelf(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A shelf with the parameters that are not fixed drawn at random."""
    return shelf(**(draw(rng, SIZES, CHOICES) | fixed))
