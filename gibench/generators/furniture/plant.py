"""Plants in pots that stand on the floor."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.greenery import PLANTS, POTS, potted
from gibench.generators.parts import Furniture

SIZES = {"width": Size(0.62, 0.40, 0.95, 0.15), "height": Size(1.15, 0.65, 1.90, 0.2)}
CHOICES = {"style": PLANTS, "pot": POTS, "arrangement": range(1000)}


def plant(*, width: float, height: float, style: str, pot: str, arrangement: int) -> Furniture:
    """A potted plant as deep as it is wide (m). arrangement: which of the ways its leaves may stand.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("plant", locals(), SIZES, CHOICES)
    return Furniture("plant", parameters, tuple(potted(style, pot, width, height, arrangement)))


def sample_plant(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A plant with the parameters that are not fixed drawn at random."""
    return plant(**(draw(rng, SIZES, CHOICES) | fixed))
