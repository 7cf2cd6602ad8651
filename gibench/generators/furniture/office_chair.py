"""Swivel chairs on five castors: with a padded or a high back, with or without arms."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import fit_parts
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import (
    bend,
    box,
    cylinder,
    merge,
    repeat,
    repeat_at,
    rod,
    rotate_x,
    rotate_y,
    rotation,
    rounded_box,
    translate,
    translation,
    tube,
)

SIZES = {
    "width": Size(0.63, 0.56, 0.72, 0.05),
    "depth": Size(0.63, 0.56, 0.72, 0.05),
    "height": Size(1.02, 0.88, 1.25, 0.07),
}
CHOICES = {"style": ("task", "task_arms", "executive"), "cover": ("fabric", "fabric", "leather")}


def office_chair(*, width: float, depth: float, height: float, style: str, cover: str) -> Furniture:
    """A swivel chair (m). cover: slot of seat and back.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("office_chair", locals(), SIZES, CHOICES)
    seat_low, seat_top = 0.42, 0.5
    reach = 0.285
    spoke = rod([0.02, 0, 0.1], [reach, 0, 0.075], 0.024, end_radius=0.014, sides=12)
    wheel = rotate_y(cylinder(0.027, -0.011, 0.011, bevel=0.004, segments=16), np.pi / 2)
    wheels = translate(
        merge([translate(wheel, [s * 0.014, 0, 0]) for s in (-1, 1)]), [reach - 0.012, 0, 0.027]
    )
    pin = rod([reach - 0.012, 0, 0.03], [reach - 0.012, 0, 0.075], 0.006, sides=8)
    turns = [rotation("z", np.pi / 2 + k * 2 * np.pi / 5) for k in range(5)]
    parts = [
        Part(repeat(merge([spoke, pin]), turns), "metal"),
        Part(repeat(wheels, turns), "plastic"),
        Part(merge([cylinder(0.034, 0.06, 0.13), cylinder(0.019, 0.12, seat_low - 0.02)]), "metal"),
        Part(box(-0.09, 0.09, -0.11, 0.1, seat_low - 0.045, seat_low + 0.01, bevel=0.008), "plastic"),
    ]
    half = 0.25
    seat = rounded_box(
        (-half, half, -0.23, 0.27, seat_low, seat_top), 0.035, swell=(0.012, 0.012, 0.014), flat=4
    )
    parts.append(Part(seat, cover))
    tall = height - 0.54
    wide = half - (0.0 if style == "executive" else 0.03)
    thick = 0.1 if style == "executive" else 0.06
    back = rounded_box(
        (-wide, wide, -thick / 2, thick / 2, 0, tall), 0.028, swell=(0.012, 0.014, 0.02), arc=2, flat=4
    )
    parts.append(Part(translate(rotate_x(back, 0.1), [0, -0.235, 0.54]), cover))
    spine = bend(
        [[0, -0.05, seat_low - 0.025], [0, -0.29, seat_low - 0.025], [0, -0.31, 0.54 + 0.5 * tall]], 0.08
    )
    parts.append(Part(tube(spine, 0.018, sides=12), "metal"))
    if style != "task":
        x = half + 0.03
        bow = [[0.04, -0.02, seat_low - 0.012], [x, -0.02, seat_low - 0.012], [x, -0.02, 0.68]]
        arm = tube(bend(bow, 0.05), 0.013, sides=10)
        arms = repeat(arm, [np.eye(4), rotation("z", np.pi) @ translation([0, 0.04, 0])])
        pads = repeat_at(
            rounded_box((-0.035, 0.035, -0.13, 0.12, 0.67, 0.7), 0.012, arc=2, flat=1),
            [[x, 0, 0], [-x, 0, 0]],
        )
        parts += [Part(arms, "metal"), Part(pads, "plastic")]
    size = np.array([width / 2, depth / 2, 0])
    return Furniture(
        "office_chair", parameters, tuple(fit_parts(parts, -size, size + np.array([0, 0, height])))
    )


def sample_office_chair(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """An office chair with the parameters that are not fixed drawn at random."""
    return office_chair(**(draw(rng, SIZES, CHOICES) | fixed))
