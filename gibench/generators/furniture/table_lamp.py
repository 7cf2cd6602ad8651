"""Table lamps: a shade on a ceramic body, a turned foot or a slim column."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.lamps import BULB, SHADES, shaded_bulb
from gibench.generators.light import fed
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import cylinder, fillet, revolve

SIZES = {"height": Size(0.50, 0.36, 0.68, 0.12), "shade_width": Size(0.30, 0.22, 0.40, 0.1), **BULB}
CHOICES = {
    "style": ("gourd", "cone", "column", "ball"),
    "shade_style": tuple(SHADES),
    "body": ("ceramic", "ceramic", "wood", "brass", "glassware"),
    "metal": ("metal", "brass", "chrome"),
}


def table_lamp(
    *,
    height: float,
    shade_width: float,
    lumens: float,
    kelvin: float,
    style: str,
    shade_style: str,
    body: str,
    metal: str,
) -> Furniture:
    """A lamp for a table (m, lm, K). shade_width: across the shade's lower rim; body, metal: slots of foot
    and holder.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("table_lamp", locals(), SIZES, CHOICES)
    parts, lights, joint = shaded_bulb(
        shade_style,
        min(shade_width, 0.72 * height),
        height,
        hanging=False,
        radius=0.03,
        metal=metal,
    )
    neck = joint - 0.015
    r = min(0.3 * shade_width, 0.42 * neck)
    line = {
        "gourd": [(0.6, 0), (0.62, 0.04), (1.0, 0.3), (0.55, 0.62), (0.42, 0.75), (0.2, 1.0)],
        "cone": [(0.95, 0), (0.95, 0.06), (0.25, 1.0)],
        "column": [(0.8, 0), (0.8, 0.08), (0.28, 0.1), (0.28, 1.0)],
        "ball": [(0.7, 0), (0.7, 0.07), (0.45, 0.1), (1.0, 0.45), (0.85, 0.8), (0.25, 0.95), (0.25, 1.0)],
    }[style]
    points = np.array([(0.0, 0.0), *line, (0.0, 1.0)]) * [r, neck]
    soft = [0, 0.004, *[0.35 * r] * (len(line) - 2), 0.004, 0]
    parts.append(Part(revolve(fillet(points, soft, segments=5), segments=32), body))
    parts.append(Part(cylinder(0.008, neck - 0.004, joint + 0.004, segments=12), metal))
    return Furniture("table_lamp", parameters, tuple(parts), (), fed(lights, lumens, kelvin), mount="surface")


def sample_table_lamp(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A table lamp with the parameters that are not fixed drawn at random."""
    return table_lamp(**(draw(rng, SIZES, CHOICES) | fixed))
