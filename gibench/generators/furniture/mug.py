"""Mugs and cups with a handle."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import centred
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import bezier, cylinder, fillet, merge, revolve, tube

SIZES = {"diameter": Size(0.085, 0.065, 0.11, 0.08), "height": Size(0.095, 0.06, 0.12, 0.09)}
CHOICES = {"style": ("straight", "round"), "content": ("empty", "coffee")}


def mug(*, diameter: float, height: float, style: str, content: str) -> Furniture:
    """A mug (m) of this diameter without its handle, which points along +x.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("mug", locals(), SIZES, CHOICES)
    r, wall = diameter / 2, 0.004
    foot = r * (0.97 if style == "straight" else 0.62)
    belly = 0.5 if style == "straight" else 0.35
    line: list[list[float]] = [
        [0, 0],
        [foot, 0],
        [r, belly * height],
        [r, height],
        [r - wall, height],
        [r - wall, belly * height],
        [foot - wall, wall],
        [0, wall],
    ]
    soft = 0.4 * height
    profile = fillet(line, [0, 0.004, soft, 0.0018, 0.0018, soft, 0.006, 0], segments=5)
    grip = 0.028
    ear = bezier(
        [
            [r - 0.002, 0, 0.82 * height],
            [r + 1.35 * grip, 0, 0.95 * height],
            [r + 1.35 * grip, 0, 0.15 * height],
            [r - 0.002, 0, 0.3 * height],
        ],
        11,
    )
    if style == "round":
        ear[-1, 0] = r * 0.96
    mesh = merge([revolve(profile, segments=32), tube(ear, 0.0045, sides=8)])
    parts = [Part(mesh, "ceramic")]
    if content == "coffee":
        parts.append(
            Part(
                cylinder(r - wall + 0.001, 0.74 * height, 0.78 * height, bevel=0.0005, segments=32),
                "soil",
                "coffee",
            )
        )
    moved, _ = centred(parts)
    return Furniture("mug", parameters, moved, mount="surface")


def sample_mug(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A mug with the parameters that are not fixed drawn at random."""
    return mug(**(draw(rng, SIZES, CHOICES) | fixed))
