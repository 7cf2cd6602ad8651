"""Rows of books that stand between book ends."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture import joinery
from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import boxes

SIZES = {
    "width": Size(0.30, 0.18, 0.60, 0.2),
    "depth": Size(0.17, 0.13, 0.21, 0.08),
    "height": Size(0.23, 0.18, 0.30, 0.08),
}
CHOICES = {"ends": ("metal", "stone", "wood", "brass"), "arrangement": range(1000)}


def book_row(*, width: float, depth: float, height: float, ends: str, arrangement: int) -> Furniture:
    """A row of books (m), spines to the front. ends: slot of the book ends; arrangement: which books.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("book_row", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    thick = 0.02 if ends in ("stone", "wood") else 0.004
    plates = [
        [s * (w - thick / 2) - thick / 2, s * (w - thick / 2) + thick / 2, -d, d, 0, height] for s in (-1, 1)
    ]
    rng = np.random.default_rng(arrangement)
    row = joinery.book_row(rng, -w + thick + 0.001, w - thick, d - 0.004, 0.0, 0.97 * height, depth - 0.02)
    return Furniture("book_row", parameters, (Part(boxes(plates, bevel=0.001), ends), *row), mount="surface")


def sample_book_row(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A row of books with the parameters that are not fixed drawn at random."""
    return book_row(**(draw(rng, SIZES, CHOICES) | fixed))
