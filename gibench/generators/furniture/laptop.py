"""Open laptop computers."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import centred
from gibench.generators.furniture.keyboard import key_rows
from gibench.generators.parts import Furniture, Mesh, Part
from gibench.generators.shapes import boxes, extrude, merge, rotate_x, rounded_rectangle, translate

SIZES = {"width": Size(0.325, 0.28, 0.38, 0.07), "opening": Size(1.85, 1.65, 2.1, 0.05)}
CHOICES = {"style": ("slim", "sturdy"), "case": ("metal", "plastic")}


def laptop(*, width: float, opening: float, style: str, case: str) -> Furniture:
    """A laptop, `width` m wide, whose lid is opened by `opening` radians. case: slot of its housing.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("laptop", locals(), SIZES, CHOICES)
    thick = 0.013 if style == "slim" else 0.02
    w, deep = width / 2, 0.68 * width
    # The hinge is the origin of this drawing; the base reaches from it to the front.
    base = extrude(rounded_rectangle(-w, w, 0, deep, 0.008), 0, thick, bevel=0.002)
    keys = key_rows(0.88 * width, 0.36 * deep, rows=5, columns=14, height=0.0015)
    keys = translate(keys, [0, 0.3 * deep, thick - 0.0005])
    pad = boxes(
        [-0.17 * width, 0.17 * width, 0.6 * deep, 0.92 * deep, thick - 0.001, thick + 0.0006], bevel=0.0004
    )
    lid = extrude(rounded_rectangle(-w, w, 0.004, deep, 0.008), 0, 0.006, bevel=0.0015)
    glass = boxes([-w + 0.006, w - 0.006, 0.018, deep - 0.006, -0.0006, 0.002], bevel=0.0004, grain=0)
    # Drawn closed, face down on the plane of the base, the lid is turned up about the hinge.

    def lift(mesh: Mesh) -> Mesh:
        return translate(rotate_x(mesh, opening), [0, 0.002, thick + 0.002])

    hinge = boxes([-0.7 * w, 0.7 * w, 0.001, 0.014, thick - 0.006, thick + 0.005], bevel=0.003)
    parts = [
        Part(merge([base, hinge, lift(lid)]), case),
        Part(keys, "plastic", "keys"),
        Part(pad, case, "pad"),
        Part(lift(glass), "screen"),
    ]
    placed, _ = centred(parts)
    return Furniture("laptop", parameters, placed, mount="surface")


def sample_laptop(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A laptop with the parameters that are not fixed drawn at random."""
    return laptop(**(draw(rng, SIZES, CHOICES) | fixed))
