"""Benches for a table, the foot of a bed or a hall."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import EMBED, legs
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import boxes, rounded_box

SIZES = {
    "width": Size(1.20, 0.80, 1.70, 0.10),
    "depth": Size(0.38, 0.30, 0.48),
    "height": Size(0.46, 0.41, 0.50, 0.04),
}
CHOICES = {"style": ("plank", "upholstered", "slab"), "finish": ("wood", "wood", "lacquer")}


def bench(*, width: float, depth: float, height: float, style: str, finish: str) -> Furniture:
    """A bench (m). finish: slot of its wooden parts.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("bench", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    thick = 0.09 if style == "upholstered" else 0.038
    under = height - thick
    if style == "upholstered":
        seat = Part(rounded_box((-w, w, -d, d, under, height), 0.035, swell=(0, 0, 0.014), flat=4), "fabric")
    else:
        seat = Part(rounded_box((-w, w, -d, d, under, height), 0.006, arc=2, flat=1), finish)
    if style == "slab":
        side = [[s - 0.02, s + 0.02, -d + 0.01, d - 0.01, 0, under + EMBED] for s in (-w + 0.12, w - 0.12)]
        side.append([-w + 0.12, w - 0.12, -0.015, 0.015, 0.45 * under, 0.45 * under + 0.1])
        return Furniture("bench", parameters, (seat, Part(boxes(side, bevel=0.003), finish)))
    x, y = w - 0.09, d - 0.06
    rails = [[-x + 0.01, x - 0.01, t - 0.01, t + 0.01, under - 0.05, under + 0.001] for t in (-y, y)]
    stand = legs("tapered", x, y, under + EMBED, 0.048, splay=0.02)
    return Furniture(
        "bench", parameters, (seat, Part(boxes(rails, bevel=0.002), finish), Part(stand, finish))
    )


def sample_bench(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A bench with the parameters that are not fixed drawn at random."""
    return bench(**(draw(rng, SIZES, CHOICES) | fixed))
