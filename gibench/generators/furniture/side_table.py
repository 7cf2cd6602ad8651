"""Small tables beside a sofa or a bed: round, tray-topped or with a C-shaped frame."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import EMBED
from gibench.generators.parts import Furniture, Part, Support
from gibench.generators.shapes import boxes, cylinder, fillet, merge, revolve, rod

SIZES = {
    "width": Size(0.45, 0.34, 0.60, 0.10),
    "height": Size(0.53, 0.42, 0.66, 0.07),
}
CHOICES = {
    "style": ("pedestal", "tray", "square"),
    "top": ("wood", "wood", "stone", "lacquer"),
    "metal": ("metal", "brass", "chrome"),
}


def side_table(*, width: float, height: float, style: str, top: str, metal: str) -> Furniture:
    """A side table as deep as it is wide (m). top, metal: slots of top and stand.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("side_table", locals(), SIZES, CHOICES)
    w = width / 2
    under = height - 0.02
    inset = 0.62 * w
    surface = height
    if style == "square":
        bars = [
            [
                s * (w - 0.02) - 0.009,
                s * (w - 0.02) + 0.009,
                t * (w - 0.02) - 0.009,
                t * (w - 0.02) + 0.009,
                0,
                under + EMBED,
            ]
            for s in (-1, 1)
            for t in (-1, 1)
        ]
        for z in (0.05, under - 0.016):
            bars += [
                [-w + 0.025, w - 0.025, t * (w - 0.02) - 0.007, t * (w - 0.02) + 0.007, z, z + 0.014]
                for t in (-1, 1)
            ]
            bars += [
                [t * (w - 0.02) - 0.007, t * (w - 0.02) + 0.007, -w + 0.025, w - 0.025, z, z + 0.014]
                for t in (-1, 1)
            ]
        parts = [
            Part(boxes([-w, w, -w, w, under, height], bevel=0.003, grain=0), top),
            Part(boxes(bars, bevel=0.001), metal),
        ]
        inset = w - 0.05
    elif style == "tray":
        lip = 0.018
        surface = height - lip
        loop = [
            [0, surface - 0.006],
            [w, surface - 0.006],
            [w, height],
            [w - 0.004, height],
            [w - 0.006, surface],
            [0, surface],
        ]
        tray = revolve(fillet(loop, [0, 0.004, 0.0015, 0.0015, 0.003, 0]), segments=48)
        sticks = []
        for k in range(3):
            angle = np.pi / 2 + k * 2 * np.pi / 3
            out = np.array([np.cos(angle), np.sin(angle), 0])
            sticks.append(
                rod(0.3 * w * out + [0, 0, surface - 0.004], 0.86 * w * out + [0, 0, 0.0085], 0.008)
            )
        ring = fillet([[0.8 * w, 0], [0.92 * w, 0], [0.92 * w, 0.012], [0.8 * w, 0.012]], 0.003, closed=True)
        parts = [Part(tray, metal), Part(merge([*sticks, revolve(ring, segments=40, closed=True)]), metal)]
    else:
        foot = fillet(
            [[0, 0], [0.7 * w, 0], [0.7 * w, 0.014], [0.02, 0.03], [0.02, under - 0.001], [0, under - 0.001]],
            [0, 0.004, 0.006, 0.04, 0, 0],
        )
        parts = [
            Part(cylinder(w, under, height, bevel=0.004, segments=48), top),
            Part(merge([revolve(foot, segments=40), cylinder(0.4 * w, under - 0.012, under + EMBED)]), metal),
        ]
    return Furniture(
        "side_table", parameters, tuple(parts), (Support(-inset, inset, -inset, inset, surface),)
    )


def sample_side_table(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A side table with the parameters that are not fixed drawn at random."""
    return side_table(**(draw(rng, SIZES, CHOICES) | fixed))
