"""Bottles with a stopper."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import cylinder, fillet, revolve

SIZES = {"width": Size(0.075, 0.05, 0.11, 0.12), "height": Size(0.29, 0.16, 0.36, 0.12)}
CHOICES = {"style": ("wine", "flask", "soap"), "material": ("glassware", "glassware", "plastic", "ceramic")}
_LINES = {
    "wine": [(1.0, 0), (1.0, 0.62), (0.36, 0.78), (0.36, 0.97)],
    "flask": [(1.0, 0), (1.0, 0.5), (0.4, 0.62), (0.4, 0.95)],
    "soap": [(0.95, 0), (1.0, 0.72), (0.3, 0.76), (0.3, 0.86)],
}


def bottle(*, width: float, height: float, style: str, material: str) -> Furniture:
    """A bottle (m). material: its slot. Raises FurnitureError for a size out of SIZES or an option out of
    CHOICES."""
    parameters = checked("bottle", locals(), SIZES, CHOICES)
    r = width / 2
    outside = np.array(_LINES[style]) * [r, height]
    soft = [0.004, 0.35 * r, 0.3 * r, 0.002]
    top = outside[-1, 1]
    line = fillet([[0, 0], *outside.tolist(), [0, top]], [0, *soft, 0], segments=6)
    line[:, 0] *= r / line[:, 0].max()
    neck = outside[-1, 0]
    cap = cylinder(neck + 0.001, top - 0.012, height, bevel=0.002, segments=20)
    parts = (
        Part(revolve(line, segments=28), material),
        Part(cap, "metal" if style == "wine" else "plastic", "cap"),
    )
    return Furniture("bottle", parameters, parts, mount="surface")


def sample_bottle(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A bottle with the parameters that are not fixed drawn at random."""
    return bottle(**(draw(rng, SIZES, CHOICES) | fixed))
