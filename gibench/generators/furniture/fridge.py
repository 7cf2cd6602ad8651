"""Refrigerators: with a freezer below, one tall door, or a low one under a worktop."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.parts import Furniture, Part, Support
from gibench.generators.shapes import boxes, merge, rounded_box

SIZES = {
    "width": Size(0.60, 0.54, 0.75, 0.05),
    "depth": Size(0.66, 0.58, 0.75, 0.04),
    "height": Size(1.80, 0.84, 2.05, 0.08),
}
CHOICES = {"style": ("freezer_below", "freezer_above", "single"), "finish": ("metal", "lacquer", "lacquer")}


def fridge(*, width: float, depth: float, height: float, style: str, finish: str) -> Furniture:
    """A refrigerator (m). finish: slot of its doors and body.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("fridge", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    grip = 0.04
    face = d - grip
    body = boxes([-w + 0.002, w - 0.002, -d, face - 0.055, 0.04, height], bevel=0.004)
    foot = boxes([-w + 0.02, w - 0.02, -d + 0.03, face - 0.09, 0, 0.045], bevel=0.003)
    low = 0.05
    split = {"freezer_below": 0.36, "freezer_above": 0.7, "single": 1.0}[style]
    cuts = [low, low + split * (height - low), height] if split < 1 else [low, height]
    doors, bars = [], []
    for k, (z0, z1) in enumerate(pairwise(cuts)):
        gap = 0.003
        doors.append(
            rounded_box(
                (
                    -w,
                    w,
                    face - 0.05,
                    face,
                    z0 + (gap if k else 0),
                    z1 - (gap if k < len(cuts) - 2 else 0.001),
                ),
                0.01,
                arc=2,
                flat=1,
            )
        )
        # Upright bars near the cut, where one reaches them.
        upper = k == len(cuts) - 2 and len(cuts) > 2
        length = min(0.5, 0.5 * (z1 - z0))
        start = z0 + 0.06 if upper else z1 - 0.06 - length
        if split == 1:
            start = (z0 + z1) / 2 - length / 2
        x = -w + 0.05
        bars.append([x - 0.009, x + 0.009, d - 0.014, d, start, start + length])
        bars += [
            [x - 0.006, x + 0.006, face - 0.003, d - 0.01, z, z + 0.02]
            for z in (start + 0.02, start + length - 0.04)
        ]
    parts = (
        Part(merge([body, *doors]), finish),
        Part(foot, "plastic"),
        Part(boxes(bars, bevel=0.003), "metal", "handle"),
    )
    support = Support(-w + 0.05, w - 0.05, -d + 0.05, face - 0.1, height, 0.3)
    return Furniture("fridge", parameters, parts, (support,))


def sample_fridge(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A fridge with the parameters that are not fixed drawn at random."""
    return fridge(**(draw(rng, SIZES, CHOICES) | fixed))
