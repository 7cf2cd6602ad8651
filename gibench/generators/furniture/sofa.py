"""Sofas for two to four, boxy, on legs with slim arms, or softly rounded, with or without throw pillows."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import leg
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import (
    pillow,
    repeat_at,
    rotate_x,
    rotate_y,
    rotate_z,
    rounded_box,
    transform,
    translate,
)
from gibench.generators.shapes.affine import rotation

SIZES = {
    "width": Size(2.40, 1.60, 3.20),
    "depth": Size(0.93, 0.78, 1.10),
    "height": Size(0.92, 0.78, 1.08, 0.08),
}
CHOICES = {
    "style": ("block", "slim", "round"),
    "seats": (2, 3),
    "cover": ("fabric", "fabric", "leather"),
    "pillows": (0, 1, 2, 3),
}


def sofa(
    *, width: float, depth: float, height: float, style: str, seats: int, cover: str, pillows: int
) -> Furniture:
    """A sofa (m). seats: cushions side by side; cover: slot of the upholstery; pillows: loose ones on it.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("sofa", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    arm = {"block": 0.2, "slim": 0.1, "round": 0.2}[style]
    foot = {"block": 0.05, "slim": 0.15, "round": 0.09}[style]
    arm_top = height * {"block": 0.72, "slim": 0.66, "round": 0.7}[style]
    radius = {"block": 0.03, "slim": 0.025, "round": 0.09}[style]
    seat_low, seat_top = max(0.24, foot + 0.1), 0.44
    back_thick = 0.16
    inner = w - arm
    parts = []
    arms = [
        rounded_box((s, s + arm, -d + 0.004, d, foot, arm_top), radius, arc=3, flat=1) for s in (-w, w - arm)
    ]
    frame = [
        rounded_box(
            (-inner - 0.03, inner + 0.03, -d + 0.02, d - 0.035, foot + 0.004, seat_low), 0.02, arc=2, flat=1
        ),
        rounded_box(
            (-inner - 0.04, inner + 0.04, -d, -d + back_thick, foot + 0.002, height),
            min(radius, 0.07),
            arc=3,
            flat=1,
        ),
    ]
    parts += [Part(mesh, cover) for mesh in (*arms, *frame)]
    one = leg("round" if style == "slim" else "square", foot + 0.02, 0.045 if style == "slim" else 0.06)
    places = [[x, y, 0] for x in (-w + 0.09, w - 0.09) for y in (-d + 0.09, d - 0.09)]
    parts.append(Part(repeat_at(one, places), "wood"))
    share = 2 * inner / seats
    for k in range(seats):
        x0 = -inner + k * share + 0.003
        x1 = x0 + share - 0.006
        seat = rounded_box(
            (x0, x1, -d + back_thick - 0.02, d - 0.005, seat_low - 0.01, seat_top),
            0.045,
            swell=(0, 0.008, 0.02),
            arc=2,
            flat=4,
        )
        thick = 0.19
        middle = (x0 + x1) / 2
        back = rounded_box(
            (x0 - middle, x1 - middle, -thick / 2, thick / 2, 0, height - seat_top - 0.03),
            0.06,
            swell=(0.004, 0.035, 0.01),
            arc=2,
            flat=4,
        )
        back = translate(
            rotate_x(back, 0.13), [middle, -d + back_thick + thick / 2 + 0.035, seat_top - 0.025]
        )
        parts += [Part(seat, cover), Part(back, cover)]
    lean = rotation("x", np.pi / 2 - 0.35)
    seat_back = -d + back_thick + 0.19
    for k, x in enumerate([-inner + 0.25, inner - 0.25, inner - 0.62][:pillows]):
        size = min(0.45, 0.9 * (height - seat_top))
        cushion = transform(pillow(size, size, 0.15, cells=10), lean)
        turn = (0.25, -0.3, 0.15)[k]
        cushion = rotate_y(rotate_z(cushion, turn), 0.06 * (-1) ** k)
        lowest = cushion.vertices[:, 2].min()
        cushion = translate(cushion, [x, seat_back + 0.13, seat_top - 0.012 - lowest])
        parts.append(Part(cushion, "fabric", f"pillow {k % 2}"))
    return Furniture("sofa", parameters, tuple(parts))


def sample_sofa(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A sofa with the parameters that are not fixed drawn at random."""
    return sofa(**(draw(rng, SIZES, CHOICES) | fixed))
