"""Stools and bar stools: three-legged, four-legged or on a column."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import EMBED, legs
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import box, cylinder, fillet, merge, revolve, rod, rounded_box

SIZES = {
    "width": Size(0.40, 0.34, 0.46, 0.06),
    "height": Size(0.46, 0.42, 0.78, 0.05),
}
CHOICES = {"style": ("round", "square", "column"), "seat": ("wood", "fabric", "leather")}


def stool(*, width: float, height: float, style: str, seat: str) -> Furniture:
    """A stool as deep as it is wide (m); seat: slot of its top. From 0.6 m on it is a bar stool with a foot
    rest.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("stool", locals(), SIZES, CHOICES)
    w = width / 2
    thick = 0.032 if seat == "wood" else 0.06
    under = height - thick
    parts = []
    if style == "square":
        if seat == "wood":
            parts.append(Part(rounded_box((-w, w, -w, w, under, height), 0.01, arc=2, flat=1), seat))
        else:
            parts.append(
                Part(
                    rounded_box((-w, w, -w, w, under, height), 0.024, swell=(0, 0, 0.012), arc=2, flat=4),
                    seat,
                )
            )
        x = w - 0.045
        rails = [box(-x, x, s * x - 0.009, s * x + 0.009, under - 0.05, under + 0.001) for s in (-1, 1)]
        rails += [box(s * x - 0.009, s * x + 0.009, -x, x, 0.3 * under, 0.3 * under + 0.025) for s in (-1, 1)]
        parts.append(Part(merge([legs("square", x, x, under + EMBED, 0.034), *rails]), "wood"))
        return Furniture("stool", parameters, tuple(parts))
    edge = 0.4 * thick
    top = fillet([[0, under], [w, under], [w, height], [0, height]], [0, edge, edge, 0], segments=4)
    parts.append(Part(revolve(top, segments=40), seat))
    if style == "column":
        foot = fillet(
            [[0, 0], [w - 0.02, 0], [w - 0.02, 0.012], [0.05, 0.03], [0, 0.03]], [0, 0.003, 0.005, 0.03, 0]
        )
        column = cylinder(0.025, 0.02, under + EMBED, bevel=0.002)
        parts.append(Part(merge([revolve(foot, segments=40), column]), "chrome"))
    else:
        reach = 0.62 * w
        parts.append(
            Part(legs("round", reach - 0.02, reach - 0.02, under + EMBED, 0.036, splay=0.035), "wood")
        )
    if height > 0.6 and style == "column":
        ring = fillet([[0.145, 0.26], [0.165, 0.26], [0.165, 0.28], [0.145, 0.28]], 0.008, closed=True)
        arms = [rod([0, s * 0.01, 0.27], [0, s * 0.15, 0.27], 0.006, sides=8) for s in (-1, 1)]
        parts.append(Part(merge([revolve(ring, segments=32, closed=True), *arms]), "chrome"))
    return Furniture("stool", parameters, tuple(parts))


def sample_stool(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A stool with the parameters that are not fixed drawn at random."""
    return stool(**(draw(rng, SIZES, CHOICES) | fixed))
