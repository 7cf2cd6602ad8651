"""Rugs: rectangular, bordered or round."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import extrude, rounded_rectangle, superellipse

SIZES = {
    "width": Size(2.00, 0.60, 4.00, 0.16),
    "depth": Size(1.40, 0.45, 3.00, 0.16),
    "height": Size(0.012, 0.006, 0.03, 0.3),
}
CHOICES = {"style": ("plain", "bordered", "oval")}


def rug(*, width: float, depth: float, height: float, style: str) -> Furniture:
    """A rug, `height` m thick. bordered: its field is another material than its border; oval: round if
    square.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("rug", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    bevel = 0.45 * height
    if style == "oval":
        mesh = extrude(superellipse(w, d, 2.0, 64), 0, height, bevel=bevel)
        return Furniture("rug", parameters, (Part(mesh, "carpet"),))
    base = extrude(rounded_rectangle(-w, w, -d, d, 0.012, segments=2), 0, height, bevel=bevel)
    if style == "plain":
        return Furniture("rug", parameters, (Part(base, "carpet"),))
    border = 0.08 * min(width, depth)
    lower = extrude(
        rounded_rectangle(-w, w, -d, d, 0.012, segments=2), 0, height - 0.0015, bevel=0.45 * height
    )
    field = rounded_rectangle(-w + border, w - border, -d + border, d - border, 0.004, segments=2)
    upper = extrude(field, 0.3 * height, height, bevel=0.001)
    return Furniture("rug", parameters, (Part(lower, "carpet", "border"), Part(upper, "carpet")))


def sample_rug(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A rug with the parameters that are not fixed drawn at random."""
    return rug(**(draw(rng, SIZES, CHOICES) | fixed))
