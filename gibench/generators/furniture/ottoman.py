"""Upholstered ottomans and round poufs."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import legs
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import fillet, revolve, rounded_box

SIZES = {
    "width": Size(0.60, 0.45, 0.90, 0.12),
    "height": Size(0.42, 0.34, 0.48, 0.07),
}
CHOICES = {"style": ("pouf", "square", "legs"), "cover": ("fabric", "fabric", "leather")}


def ottoman(*, width: float, height: float, style: str, cover: str) -> Furniture:
    """An ottoman as deep as it is wide (m). cover: slot of the upholstery.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("ottoman", locals(), SIZES, CHOICES)
    w = width / 2
    if style == "pouf":
        line: list[list[float]] = [
            [0, 0],
            [0.8 * w, 0],
            [w, 0.42 * height],
            [0.86 * w, 0.94 * height],
            [0, height],
        ]
        profile = fillet(line, [0, 0.05, 0.4, 0.06, 0], segments=7)
        profile[:, 0] *= w / profile[:, 0].max()
        return Furniture("ottoman", parameters, (Part(revolve(profile, segments=40), cover),))
    low = 0.14 if style == "legs" else 0.03
    seam = height - 0.14
    parts = [
        Part(
            rounded_box(
                (-w + 0.006, w - 0.006, -w + 0.006, w - 0.006, low, seam + 0.01), 0.02, arc=2, flat=1
            ),
            cover,
        ),
        Part(rounded_box((-w, w, -w, w, seam, height), 0.045, swell=(0, 0, 0.018), arc=3, flat=4), cover),
    ]
    kind = "round" if style == "legs" else "square"
    parts.append(Part(legs(kind, w - 0.08, w - 0.08, low + 0.01, 0.045), "wood"))
    return Furniture("ottoman", parameters, tuple(parts))


def sample_ottoman(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """An ottoman with the parameters that are not fixed drawn at random."""
    return ottoman(**(draw(rng, SIZES, CHOICES) | fixed))
