"""Wall lamps: a shade on an arm, or an uplighter."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import centred
from gibench.generators.furniture.lamp_light import out_of_bowl, turned_area
from gibench.generators.furniture.lamps import BULB, glow, shaded_bulb, within
from gibench.generators.light import fed
from gibench.generators.light_shapes import SHADE_SEGMENTS
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import box, fillet, merge, revolve, rod, translate

SIZES = {"height": Size(0.24, 0.18, 0.32, 0.1), "width": Size(0.18, 0.13, 0.24, 0.1), **BULB}
CHOICES = {"style": ("shade", "uplight"), "metal": ("metal", "brass", "chrome", "lacquer")}


def wall_lamp(
    *, height: float, width: float, lumens: float, kelvin: float, style: str, metal: str
) -> Furniture:
    """A lamp for a wall (m, lm, K). metal: slot of its fittings.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("wall_lamp", locals(), SIZES, CHOICES)
    w = width / 2
    gap = 0.045
    y = w  # of the shade, in a frame whose wall is at y = -gap
    if style == "shade":
        parts, lights, joint = shaded_bulb(
            "empire", width, height, hanging=False, radius=0.03, metal=metal, at=(0.0, y)
        )
        low = 0.0
        plate = box(-0.035, 0.035, -gap, -gap + 0.012, low, low + 0.12, bevel=0.004)
        bar = [
            rod([0, -gap + 0.01, 0.05], [0, y, 0.05], 0.006),
            rod([0, y, 0.044], [0, y, joint + 0.004], 0.007),
        ]
    else:
        r = w
        line = [[0, 0.0], [0.35 * r, 0.0], [r, height], [r - 0.003, height], [0.33 * r, 0.012], [0, 0.012]]
        profile = fillet(line, [0, 0.3 * r, 0.001, 0.001, 0.3 * r, 0], segments=6)
        profile[:, 0] *= r / profile[:, 0].max()
        bowl = revolve(profile, segments=SHADE_SEGMENTS)
        parts = [Part(translate(bowl, [0, y, 0]), metal)]
        # From the rim inside down to the axis; the rim itself is rounded.
        hollow = profile[np.argmax(profile[:, 1]) :]
        share = out_of_bowl(r - 0.003, turned_area(hollow), 0.38 * height)
        shown = height - 0.004
        wide = within(float(np.interp(shown, *hollow[::-1].T[::-1])))
        lights = [glow("above", wide, (0.0, y, shown), True, share)]
        plate = box(-0.035, 0.035, -gap, -gap + 0.012, 0.25 * height, 0.25 * height + 0.1, bevel=0.004)
        bar = [
            rod([0, -gap + 0.01, 0.25 * height + 0.05], [0, 0.5 * y, 0.25 * height + 0.05], 0.008),
        ]
    parts.append(Part(merge([plate, *bar]), metal))
    moved, placed = centred(parts, fed(lights, lumens, kelvin))
    return Furniture("wall_lamp", parameters, moved, (), placed, mount="wall")


def sample_wall_lamp(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A wall lamp with the parameters that are not fixed drawn at random."""
    return wall_lamp(**(draw(rng, SIZES, CHOICES) | fixed))
