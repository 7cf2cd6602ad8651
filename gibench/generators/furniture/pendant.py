"""Pendant lamps: a fabric shade, a metal dome, or a bulb in a cage, on a cable below a ceiling rose."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import EMBED
from gibench.generators.furniture.lamp_light import out_of_bowl, turned_area
from gibench.generators.furniture.lamps import BULB, RECESS, SHADES, bulb, glow, shaded_bulb, within
from gibench.generators.light import fed
from gibench.generators.light_shapes import SHADE_SEGMENTS
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import (
    bezier,
    cylinder,
    fillet,
    merge,
    repeat,
    revolve,
    rotation,
    torus,
    translate,
    tube,
)

SIZES = {"height": Size(0.75, 0.45, 1.40, 0.2), "shade_width": Size(0.40, 0.24, 0.55, 0.15), **BULB}
CHOICES = {"style": (*SHADES, "dome", "cage"), "metal": ("metal", "brass", "lacquer", "chrome")}


def pendant(
    *, height: float, shade_width: float, lumens: float, kelvin: float, style: str, metal: str
) -> Furniture:
    """A lamp that hangs `height` m down from the ceiling (z = 0) with one bulb (lm, K).

    shade_width: across the lower rim (m). metal: slot of dome, socket and rose.
    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("pendant", locals(), SIZES, CHOICES)
    rose = cylinder(0.05, -0.028, 0.0, top_radius=0.055, bevel=0.003)
    if style in SHADES:
        top = -height + SHADES[style][1] * shade_width
        parts, lights, joint = shaded_bulb(style, shade_width, top, hanging=True, radius=0.04, metal=metal)
    elif style == "dome":
        r, tall = shade_width / 2, 0.55 * shade_width
        turn = np.linspace(0, 0.96 * np.pi / 2, 10)
        outer = np.stack([r * np.cos(turn) ** 0.8, -height + tall * np.sin(turn)], 1)
        thick = 0.0018
        inner = outer[::-1] - [thick, thick]
        inner[-1, 1] = -height
        peak = -height + tall
        loop = np.concatenate([[[0, peak - 2 * thick]], inner, outer, [[0, peak]]])
        parts = [Part(revolve(loop, segments=SHADE_SEGMENTS), metal)]
        share = out_of_bowl(r - thick, turned_area(inner), 0.35 * tall)
        lights = [glow("below", within(0.999 * r - thick), (0.0, 0.0, -height + RECESS), False, share)]
        stem = (peak - 0.05, peak + 0.05)
        parts.append(Part(cylinder(0.02, *stem, segments=16), metal))
        joint = peak + 0.05
    else:
        radius, tall = 0.045, min(0.8 * shade_width, height - 0.1)
        joint = -height + tall
        lights = [bulb((0.0, 0.0, joint - 0.063 - radius), radius)]
        corners = [
            [0.02, 0, joint - 0.03],
            [0.3 * shade_width, 0, joint - 0.06],
            [shade_width / 2, 0, -height + 0.03],
            [0.34 * shade_width, 0, -height + 0.002],
        ]
        wire = tube(bezier(corners, 12), 0.0015, sides=6)
        wires = [repeat(wire, [rotation("z", k * np.pi / 4) for k in range(8)])]
        for r, z in ((0.34 * shade_width, -height + 0.0025), (0.39 * shade_width, -height + 0.42 * tall)):
            wires.append(translate(torus(r, 0.0025, segments=40, sides=6), [0, 0, z]))
        cap = fillet(
            [[0, joint - 0.06], [0.022, joint - 0.06], [0.022, joint - 0.02], [0.006, joint], [0, joint]],
            [0, 0.003, 0.01, 0.004, 0],
        )
        parts = [Part(merge([revolve(cap, segments=20), *wires]), metal)]
    parts.append(Part(rose, metal))
    parts.append(Part(cylinder(0.003, joint - 2 * EMBED, -0.02, bevel=0.0005, segments=8), "plastic"))
    return Furniture("pendant", parameters, tuple(parts), (), fed(lights, lumens, kelvin), mount="ceiling")


def sample_pendant(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A pendant with the parameters that are not fixed drawn at random."""
    return pendant(**(draw(rng, SIZES, CHOICES) | fixed))
