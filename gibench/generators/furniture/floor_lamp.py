"""Floor lamps: a shade on a column, on a wooden tripod, or hanging from an arc."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import centred
from gibench.generators.furniture.lamps import BULB, SHADES, shaded_bulb
from gibench.generators.light import fed
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import bend, circle, cylinder, loft, merge, tube

SIZES = {"height": Size(1.87, 1.45, 2.10, 0.05), "shade_width": Size(0.42, 0.32, 0.52), **BULB}
CHOICES = {
    "style": ("column", "tripod", "arc"),
    "shade_style": tuple(SHADES),
    "metal": ("metal", "chrome", "brass"),
}
_RADIUS = 0.035  # of the bulb


def floor_lamp(
    *,
    height: float,
    shade_width: float,
    lumens: float,
    kelvin: float,
    style: str,
    shade_style: str,
    metal: str,
) -> Furniture:
    """A standing lamp (m, lm, K). shade_width: across the shade's lower rim; metal: slot of the stand.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("floor_lamp", locals(), SIZES, CHOICES)
    reach, stem = 0.75, 0.012
    parts, lights, joint = shaded_bulb(
        shade_style,
        shade_width,
        height - 0.12 if style == "arc" else height,
        hanging=style == "arc",
        radius=_RADIUS,
        metal=metal,
        at=(0.0, reach) if style == "arc" else (0.0, 0.0),
    )
    if style == "arc":
        level = height - stem
        corners = [[0, 0, 0.03], [0, 0, level], [0, reach, level], [0, reach, joint - 0.004]]
        path = bend(corners, 0.33, segments=8)
        parts.append(Part(tube(path, stem, sides=12), metal))
        parts.append(Part(cylinder(0.15, 0, 0.05, bevel=0.006, segments=40), "stone"))
    elif style == "column":
        parts.append(Part(cylinder(0.011, 0.015, joint + 0.004, segments=16), metal))
        parts.append(Part(cylinder(0.145, 0, 0.022, bevel=0.004, segments=40), metal))
    else:
        hub, spread = joint - 0.14, 0.3
        sticks = []
        for angle in np.pi / 2 + np.arange(3) * 2 * np.pi / 3:
            out = np.array([np.cos(angle), np.sin(angle)])
            foot, head = [*(spread * out), 0.0], [*(0.02 * out), hub + 0.04]
            rows = [[0, 0, *foot], [1, 1, *foot], [1.5, 1.5, *head], [0, 0, *head]]
            sticks.append(loft(circle(0.01, 12), rows))
        parts.append(Part(merge(sticks), "wood"))
        parts.append(Part(cylinder(0.036, hub, hub + 0.05, bevel=0.004), metal))
        parts.append(Part(cylinder(0.009, hub + 0.03, joint + 0.004, segments=12), metal))
    placed, moved = centred(parts, fed(lights, lumens, kelvin))
    return Furniture("floor_lamp", parameters, placed, (), moved)


def sample_floor_lamp(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A floor lamp with the parameters that are not fixed drawn at random."""
    return floor_lamp(**(draw(rng, SIZES, CHOICES) | fixed))
