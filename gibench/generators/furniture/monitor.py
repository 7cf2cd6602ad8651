"""Computer monitors on a foot."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import box, extrude, merge, rounded_rectangle

SIZES = {
    "width": Size(0.58, 0.48, 0.85, 0.10),
    "depth": Size(0.20, 0.17, 0.26, 0.08),
    "height": Size(0.47, 0.42, 0.58, 0.06),
}
CHOICES = {"style": ("plate", "round", "vee"), "case": ("plastic", "metal")}


def monitor(*, width: float, depth: float, height: float, style: str, case: str) -> Furniture:
    """A monitor (m) with a 16:9 screen as far as its height allows. style: its foot; case: slot of its
    housing.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("monitor", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    tall = min(width * 9 / 16 + 0.012, height - 0.07)
    low = height - tall
    y = 0.01
    housing = box(-w, w, y - 0.02, y + 0.01, low, height, bevel=0.003)
    bulge = box(
        -0.3 * width, 0.3 * width, y - 0.045, y - 0.015, low + 0.2 * tall, low + 0.8 * tall, bevel=0.01
    )
    glass = box(
        -w + 0.006, w - 0.006, y + 0.006, y + 0.011, low + 0.014, height - 0.006, bevel=0.0005, grain=0
    )
    neck = box(-0.03, 0.03, y - 0.075, y - 0.04, 0.008, low + 0.6 * tall, bevel=0.006)
    foot_w = 0.13
    if style == "vee":
        outline = np.array(
            [
                [-foot_w, d],
                [-foot_w + 0.03, d],
                [0, -d + 0.06],
                [foot_w - 0.03, d],
                [foot_w, d],
                [0.03, -d],
                [-0.03, -d],
            ]
        )
    else:
        outline = rounded_rectangle(
            -foot_w, foot_w, -d, d, 0.95 * d if style == "round" else 0.012, segments=8
        )
    foot = extrude(outline, 0, 0.011, bevel=0.002)
    parts = (
        Part(merge([housing, bulge]), case),
        Part(glass, "screen"),
        Part(merge([neck, foot]), case, "stand"),
    )
    return Furniture("monitor", parameters, parts, mount="surface")


def sample_monitor(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A monitor with the parameters that are not fixed drawn at random."""
    return monitor(**(draw(rng, SIZES, CHOICES) | fixed))
