"""Open showers: a tray and a riser with a rain or a hand shower."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import (
    bend,
    box,
    cylinder,
    merge,
    rod,
    rotate_x,
    rounded_rectangle,
    stacked,
    translate,
    tube,
)

SIZES = {
    "width": Size(0.90, 0.75, 1.20, 0.08),
    "depth": Size(0.90, 0.75, 1.10, 0.08),
    "height": Size(2.10, 1.95, 2.20, 0.02),
}
CHOICES = {"style": ("rain", "hand"), "metal": ("chrome", "chrome", "brass", "metal")}


def shower(*, width: float, depth: float, height: float, style: str, metal: str) -> Furniture:
    """A shower without walls of its own, its riser at the back (m). metal: slot of the fittings.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("shower", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    tall, floor = 0.045, 0.022
    steps = [
        (0.0, 0.0),
        (0.0, 0.0),
        (0.0, tall - 0.006),
        (0.006, tall),
        (0.045, tall),
        (0.055, floor + 0.006),
        (0.07, floor),
        (0.2, floor - 0.002),
    ]
    outlines = [rounded_rectangle(-w + e, w - e, -d + e, d - e, 0.02) for e, _ in steps]
    tray = stacked(outlines, [z for _, z in steps])
    parts = [Part(tray, "enamel"), Part(cylinder(0.05, floor - 0.004, floor + 0.002, bevel=0.001), "chrome")]
    y = -d + 0.045
    mixer = box(-0.15, 0.15, y - 0.02, y + 0.025, 1.05, 1.09, bevel=0.01)
    mounts = [box(-0.011, 0.011, -d, y, z, z + 0.022, bevel=0.004) for z in (1.059, 1.7)]
    if style == "rain":
        radius = 0.011
        top = height - radius
        riser = tube(
            bend([[0, y, 1.07], [0, y, top], [0, y + 0.4, top], [0, y + 0.4, top - 0.08]], 0.06), radius
        )
        head = translate(cylinder(0.12, -0.012, 0.0, bevel=0.003, segments=40), [0, y + 0.4, top - 0.075])
        parts.append(Part(merge([mixer, *mounts, riser, head]), metal))
    else:
        riser = cylinder(0.011, 1.07, height, bevel=0.003, centre=(0, y))
        low = [0, y + 0.055, height - 0.32]
        wand = rod(low, [0, y + 0.13, height - 0.13], 0.011, end_radius=0.014)
        rose = translate(
            rotate_x(cylinder(0.05, -0.016, 0.0, bevel=0.004), 0.9), [0, y + 0.145, height - 0.13]
        )
        holder = box(-0.014, 0.014, y - 0.015, y + 0.075, height - 0.28, height - 0.25, bevel=0.004)
        hose = bend(
            [
                [0, y + 0.055, height - 0.315],
                [0.0, y + 0.05, 0.75],
                [0.1, y + 0.05, 0.75],
                [0.1, y + 0.01, 1.06],
            ],
            0.05,
            segments=8,
        )
        parts.append(
            Part(merge([mixer, *mounts, riser, wand, rose, holder, tube(hose, 0.006, sides=8)]), metal)
        )
    return Furniture("shower", parameters, tuple(parts))


def sample_shower(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A shower with the parameters that are not fixed drawn at random."""
    return shower(**(draw(rng, SIZES, CHOICES) | fixed))
