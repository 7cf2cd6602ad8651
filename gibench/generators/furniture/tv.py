"""Flat television sets that stand on a board."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import box, boxes, extrude, merge, rod, rounded_rectangle

SIZES = {
    "width": Size(1.22, 0.72, 1.70, 0.15),
    "depth": Size(0.25, 0.20, 0.32, 0.08),
}
CHOICES = {"style": ("feet", "pedestal", "bar")}
_ASPECT = 9 / 16


def tv(*, width: float, depth: float, style: str) -> Furniture:
    """A television set with a 16:9 screen, `width` m wide, on a stand `depth` m deep.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("tv", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    low = 0.07
    bezel = 0.008
    high = low + (width - 2 * bezel) * _ASPECT + 2 * bezel + 0.006
    y0, y1 = -0.018, 0.012
    body = box(-w, w, y0, y1, low, high, bevel=0.003)
    belly = box(
        -0.32 * width, 0.32 * width, y0 - 0.025, y0 + 0.004, low + 0.05, low + 0.6 * (high - low), bevel=0.012
    )
    glass = box(
        -w + bezel,
        w - bezel,
        y1 - 0.003,
        y1 + 0.001,
        low + bezel + 0.006,
        high - bezel,
        bevel=0.0005,
        grain=0,
    )
    parts = [Part(merge([body, belly]), "plastic", "body"), Part(glass, "screen")]
    if style == "feet":
        feet = []
        for x in (-0.36 * width, 0.36 * width):
            feet += [rod([x, s * (d - 0.008), 0.008], [x, 0, low + 0.012], 0.008, sides=8) for s in (-1, 1)]
            feet.append(box(x - 0.009, x + 0.009, -d, d, 0, 0.012, bevel=0.003))
        parts.append(Part(merge(feet), "metal", "stand"))
    elif style == "pedestal":
        plate = extrude(rounded_rectangle(-0.2 * width, 0.2 * width, -d, d, 0.03), 0, 0.012, bevel=0.003)
        neck = box(-0.05, 0.05, y0 - 0.02, y0 + 0.005, 0.01, low + 0.1, bevel=0.006)
        parts.append(Part(merge([plate, neck]), "metal", "stand"))
    else:
        bars = [
            [-0.3 * width, 0.3 * width, -d, d, 0, 0.015],
            [-0.29 * width, 0.29 * width, -0.015, 0.009, 0.012, low + 0.004],
        ]
        parts.append(Part(boxes(bars, bevel=0.004), "plastic", "body"))
    return Furniture("tv", parameters, tuple(parts), mount="surface")


def sample_tv(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A tv with the parameters that are not fixed drawn at random."""
    return tv(**(draw(rng, SIZES, CHOICES) | fixed))
