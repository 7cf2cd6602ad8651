"""Stacks of books that lie flat."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import boxes, rotate_z

SIZES = {"width": Size(0.24, 0.18, 0.34, 0.1), "height": Size(0.12, 0.06, 0.24, 0.2)}
CHOICES = {"style": ("neat", "loose"), "arrangement": range(1000)}


def books(*, width: float, height: float, style: str, arrangement: int) -> Furniture:
    """A stack of books `width` m long and `height` m high. arrangement: which books.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("books", locals(), SIZES, CHOICES)
    rng = np.random.default_rng(arrangement)
    count = int(np.clip(round(height / 0.032), 2, 6))
    shares = rng.uniform(0.6, 1.4, count)
    ends = np.concatenate([[0.0], np.cumsum(height * shares / shares.sum())])
    parts = []
    for k, (z0, z1) in enumerate(pairwise(ends)):
        # The lowest book is the largest and lies straight, so that the others stay above it as they are turned.
        long = width / 2 * (1.0 if k == 0 else 0.84 - 0.05 * k + 0.04 * rng.uniform())
        wide = 0.7 * long
        top = z1 - (0.001 if k < count - 1 else 0.0)
        board = 0.0025
        covers = [[-long, long, -wide, wide, z0, z0 + board], [-long, long, -wide, wide, top - board, top]]
        covers.append([-long + 0.0004, long - 0.0004, wide - 0.004, wide - 0.0003, z0 + 0.0008, top - 0.0008])
        pages = [-long + 0.003, long - 0.003, -wide + 0.003, wide - 0.003, z0 + 0.0015, top - 0.0015]
        turn = (0.03 if style == "neat" else 0.12) * (rng.uniform(-1, 1) if k else 0.0)
        for extents, bevel, variant in ((covers, 0.0006, f"cover {k}"), ([pages], 0.0, "pages")):
            parts.append(Part(rotate_z(boxes(extents, bevel=bevel), turn), "paper", variant))
    return Furniture("books", parameters, tuple(parts), mount="surface")


def sample_books(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A books with the parameters that are not fixed drawn at random."""
    return books(**(draw(rng, SIZES, CHOICES) | fixed))
