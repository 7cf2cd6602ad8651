"""Little potted plants for tables, shelves and sills."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.greenery import PLANTS, POTS, potted
from gibench.generators.parts import Furniture

SIZES = {"width": Size(0.20, 0.12, 0.32, 0.18), "height": Size(0.28, 0.18, 0.42, 0.18)}
CHOICES = {"style": PLANTS, "pot": POTS, "arrangement": range(1000)}


def small_plant(*, width: float, height: float, style: str, pot: str, arrangement: int) -> Furniture:
    """A small potted plant as deep as it is wide (m). arrangement: which of the ways its leaves may stand.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("small_plant", locals(), SIZES, CHOICES)
    parts = potted(style, pot, width, height, arrangement)
    return Furniture("small_plant", parameters, tuple(parts), mount="surface")


def sample_small_plant(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A small plant with the parameters that are not fixed drawn at random."""
    return small_plant(**(draw(rng, SIZES, CHOICES) | fixed))
