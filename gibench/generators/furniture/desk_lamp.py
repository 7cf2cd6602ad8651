"""Desk lamps with jointed arms and a metal shade that opens downwards."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import centred
from gibench.generators.furniture.lamp_light import out_of_bowl, turned_area
from gibench.generators.furniture.lamps import BULB, RECESS, glow, within
from gibench.generators.light import fed
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import cylinder, merge, revolve, rod, rotate_y, translate

SIZES = {"height": Size(0.48, 0.38, 0.60, 0.09), "reach": Size(0.26, 0.18, 0.34, 0.1), **BULB}
CHOICES = {"style": ("jointed", "straight"), "finish": ("lacquer", "metal", "brass", "chrome")}


def desk_lamp(
    *, height: float, reach: float, lumens: float, kelvin: float, style: str, finish: str
) -> Furniture:
    """A desk lamp (m, lm, K) whose head hangs `reach` m in front of its foot. finish: slot of all of it.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("desk_lamp", locals(), SIZES, CHOICES)
    foot = cylinder(0.085, 0, 0.018, bevel=0.004, segments=32)
    head_r, head_h, cap = 0.07, 0.105, 0.014
    elbow = np.array([0, -0.3 * reach if style == "jointed" else 0.0, height - 0.011])
    tip = np.array([0, reach, 0.86 * height])
    meshes = [foot, rod([0, 0, 0.01], elbow, 0.006), rod(elbow, tip, 0.006)]
    hinge = cylinder(0.011, -0.012, 0.012, bevel=0.002, segments=16)
    for place in ([0, 0, 0.03], elbow, tip):
        meshes.append(translate(rotate_y(hinge, np.pi / 2), place))
    z1 = tip[2] - 0.005
    wall = 0.0015
    outside = [
        [head_r, z1 - head_h],
        [0.55 * head_r, z1 - 0.35 * head_h],
        [0.022, z1 - cap],
        [0.018, z1],
        [0, z1],
    ]
    inside = [
        [0, z1 - cap - 0.002],
        [0.02, z1 - cap - 0.002],
        [0.55 * head_r - wall, z1 - 0.36 * head_h],
        [head_r - wall, z1 - head_h],
    ]
    shade = revolve(np.array([*inside, *outside]), segments=32)
    meshes.append(translate(shade, [0, reach, 0]))
    share = out_of_bowl(head_r - wall, turned_area(np.array(inside)), 0.38 * head_h)
    wide = within(head_r - wall - 0.02 * head_r)
    light = glow("below", wide, (0.0, reach, float(z1 - head_h + RECESS)), False, share)
    placed, lights = centred([Part(merge(meshes), finish)], fed([light], lumens, kelvin))
    return Furniture("desk_lamp", parameters, placed, (), lights, mount="surface")


def sample_desk_lamp(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A desk lamp with the parameters that are not fixed drawn at random."""
    return desk_lamp(**(draw(rng, SIZES, CHOICES) | fixed))
