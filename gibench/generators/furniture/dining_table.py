"""Dining tables: four legs, trestles, or a round column under a rectangular, rounded or oval top."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import EMBED, LEG_STYLES, legs, post
from gibench.generators.parts import Furniture, Part, Support
from gibench.generators.shapes import (
    boxes,
    cylinder,
    extrude,
    fillet,
    merge,
    revolve,
    rounded_rectangle,
    superellipse,
)

SIZES = {
    "width": Size(1.48, 1.00, 2.20),
    "depth": Size(0.96, 0.75, 1.20),
    "height": Size(0.76, 0.71, 0.80, 0.03),
}
CHOICES = {
    "style": (*LEG_STYLES, "trestle", "pedestal"),
    "top": ("rectangular", "rounded", "oval"),
    "finish": ("wood", "wood", "wood", "lacquer"),
}


def dining_table(
    *, width: float, depth: float, height: float, style: str, top: str, finish: str
) -> Furniture:
    """A dining table (m). style: what it stands on; top: the outline; finish: slot of wood parts.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("dining_table", locals(), SIZES, CHOICES)
    thick = 0.032
    under = height - thick
    w, d = width / 2, depth / 2
    outline = {
        "rectangular": rounded_rectangle(-w, w, -d, d, 0.01, segments=2),
        "rounded": rounded_rectangle(-w, w, -d, d, 0.12, segments=6),
        "oval": superellipse(w, d, 2.6, 56),
    }[top]
    parts = [Part(extrude(outline, under, height, bevel=0.004), finish)]
    # An oval leaves less room at the corners.
    inset = 0.3 * depth if top == "oval" else 0.07
    if style in LEG_STYLES:
        size = 0.075
        x, y = w - inset - size / 2, d - 0.55 * inset - size / 2
        parts.append(Part(legs(style, x, y, under + EMBED, size), finish))
        apron = (under - 0.085, under + EMBED / 2)
        end_x, end_y = x - 0.015, y - 0.015  # inside the legs, short of each other
        rails = [[-end_x, end_x, s * y - 0.011, s * y + 0.011, *apron] for s in (-1, 1)]
        rails += [[s * x - 0.011, s * x + 0.011, -end_y, end_y, apron[0] + 0.001, apron[1]] for s in (-1, 1)]
        parts.append(Part(boxes(rails, bevel=0.002), finish))
    elif style == "trestle":
        x, y = w - 0.2 * width, d - 0.16 * depth
        stand = []
        for s in (-1, 1):
            stand += [
                post(0.06, 0.05, [[s * x, t * (y - 0.02), 0.02], [s * x, t * 0.3 * y, under - 0.04]])
                for t in (-1, 1)
            ]
        bars = [[s * x - 0.035, s * x + 0.035, -y, y, 0, 0.04] for s in (-1, 1)]
        bars += [
            [s * x - 0.035, s * x + 0.035, -0.8 * y, 0.8 * y, under - 0.06, under + EMBED] for s in (-1, 1)
        ]
        bars.append([-x, x, -0.02, 0.02, 0.3 * under, 0.3 * under + 0.09])
        parts.append(Part(merge([*stand, boxes(bars, bevel=0.004)]), finish))
    else:
        reach = 0.62 * d
        foot = fillet(
            [
                [0, 0],
                [reach, 0],
                [reach, 0.018],
                [0.2 * reach, 0.05],
                [0.055, 0.14],
                [0.055, under - 0.05],
                [0, under - 0.05],
            ],
            [0, 0.004, 0.008, 0.1, 0.1, 0, 0],
        )
        plate = cylinder(0.3 * d + 0.1, under - 0.06, under + EMBED, bevel=0.004, segments=32)
        slot = "metal" if finish == "lacquer" else finish
        parts += [Part(revolve(foot, segments=40), slot, "foot"), Part(plate, slot, "foot")]
    margin = 0.3 * depth if top == "oval" else 0.09
    support = Support(-w + margin, w - margin, -d + 0.6 * margin, d - 0.6 * margin, height)
    return Furniture("dining_table", parameters, tuple(parts), (support,))


def sample_dining_table(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A dining table with the parameters that are not fixed drawn at random."""
    return dining_table(**(draw(rng, SIZES, CHOICES) | fixed))
