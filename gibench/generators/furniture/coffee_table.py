"""Coffee tables: a board on legs, a slab of stone on metal, a round drum, or a table with a lower shelf."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import EMBED, legs
from gibench.generators.parts import Furniture, Part, Support
from gibench.generators.shapes import boxes, extrude, loft, rounded_rectangle, superellipse

SIZES = {
    "width": Size(1.13, 0.75, 1.50),
    "depth": Size(0.66, 0.48, 0.90),
    "height": Size(0.44, 0.34, 0.52),
}
CHOICES = {
    "style": ("legs", "shelf", "frame", "oval"),
    "finish": ("wood", "wood", "lacquer"),
    "metal": ("metal", "brass", "chrome"),
}


def coffee_table(
    *, width: float, depth: float, height: float, style: str, finish: str, metal: str
) -> Furniture:
    """A coffee table (m). finish: slot of wooden parts; metal: slot of the frame under a stone top.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("coffee_table", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    thick = 0.022 if style == "frame" else 0.03
    under = height - thick
    inset = 0.06
    supports = [Support(-w + 0.06, w - 0.06, -d + 0.06, d - 0.06, height)]
    if style == "oval":
        top = superellipse(w, d, 2.3, 56)
        parts = [Part(extrude(top, under, height, bevel=0.006), finish)]
        base = superellipse(0.55 * w, 0.55 * d, 2.3, 56)
        rows: list[list[float]] = [
            [0, 0, 0],
            [1, 1, 0],
            [1, 1, 0.02],
            [0.62, 0.62, 0.45 * under],
            [0.62, 0.62, 0.55 * under],
            [0.95, 0.95, under + EMBED],
            [0, 0, under + EMBED],
        ]
        profile = [[a, b, 0, 0, z] for a, b, z in rows]
        parts.append(Part(loft(base, profile), finish, "foot"))
        supports = [Support(-0.6 * w, 0.6 * w, -0.6 * d, 0.6 * d, height)]
    elif style == "frame":
        outline = rounded_rectangle(-w, w, -d, d, 0.02)
        parts = [Part(extrude(outline, under, height, bevel=0.003), "stone")]
        bar = 0.02
        x, y = w - inset, d - inset
        bars = [
            [s - bar / 2, s + bar / 2, t - bar / 2, t + bar / 2, 0, under + EMBED]
            for s in (-x, x)
            for t in (-y, y)
        ]
        reach_x, reach_y = x - bar / 2 + EMBED, y - bar / 2 + EMBED
        for z in (0.001, under - bar - 0.001):
            bars += [
                [-reach_x, reach_x, t - bar / 2 + 0.001, t + bar / 2 - 0.001, z, z + bar] for t in (-y, y)
            ]
            bars += [
                [
                    s - bar / 2 + 0.001,
                    s + bar / 2 - 0.001,
                    -reach_y - 0.0015,
                    reach_y + 0.0015,
                    z + 0.0007,
                    z + bar - 0.0007,
                ]
                for s in (-x, x)
            ]
        parts.append(Part(boxes(bars, bevel=0.001), metal))
    else:
        outline = rounded_rectangle(-w, w, -d, d, 0.03)
        parts = [Part(extrude(outline, under, height, bevel=0.004), finish)]
        size = 0.05
        x, y = w - inset - size / 2, d - inset - size / 2
        parts.append(
            Part(
                legs(
                    "square" if style == "shelf" else "round",
                    x,
                    y,
                    under + EMBED,
                    size,
                    splay=0 if style == "shelf" else 0.03,
                ),
                finish,
            )
        )
        if style == "shelf":
            board = 0.13
            parts.append(Part(boxes([-x, x, -y, y, board - 0.018, board], bevel=0.002), finish))
            supports.append(Support(-x + 0.06, x - 0.06, -y + 0.06, y - 0.06, board, under - board - 0.02))
        else:
            rails = [[-x, x, t - 0.01, t + 0.01, under - 0.05, under + 0.001] for t in (-y, y)]
            parts.append(Part(boxes(rails, bevel=0.002), finish))
    return Furniture("coffee_table", parameters, tuple(parts), tuple(supports))


def sample_coffee_table(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A coffee table with the parameters that are not fixed drawn at random."""
    return coffee_table(**(draw(rng, SIZES, CHOICES) | fixed))
