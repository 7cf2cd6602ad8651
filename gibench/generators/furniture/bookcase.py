"""Bookcases with rows of books on their boards."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import book_row
from gibench.generators.parts import Furniture, Part, Support
from gibench.generators.shapes import boxes, merge

SIZES = {
    "width": Size(0.85, 0.50, 1.30, 0.15),
    "depth": Size(0.30, 0.24, 0.38),
    "height": Size(1.95, 1.20, 2.25, 0.09),
    "fill": Size(0.7, 0.3, 1.0, 0.2),
}
CHOICES = {
    "style": ("plain", "cornice", "divided"),
    "finish": ("wood", "wood", "lacquer"),
    "arrangement": range(1000),
}
_PITCH = 0.34  # from board to board (m)


def bookcase(
    *, width: float, depth: float, height: float, fill: float, style: str, finish: str, arrangement: int
) -> Furniture:
    """A bookcase (m). fill: share of each board's length that books take; arrangement: which books.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("bookcase", locals(), SIZES, CHOICES)
    rng = np.random.default_rng(arrangement)
    w, d = width / 2, depth / 2
    side, thick, low = 0.022, 0.022, 0.08
    proud = 0.015 if style == "cornice" else 0.0
    x = w - proud
    top = height - 0.03 if style == "cornice" else height
    inner = x - side
    rows = max(2, round((top - low) / _PITCH))
    levels = np.linspace(low, top, rows + 1)
    front = d - proud
    bars = [[s, s + side, -d, front, 0, top + (0.002 if proud else 0.0)] for s in (-x, x - side)]
    bars += [[-inner - 0.003, inner + 0.003, -d + 0.006, front - 0.003, z - thick, z] for z in levels[:-1]]
    bars.append([-inner - 0.003, inner + 0.003, -d + 0.006, front - 0.003, top - thick - 0.001, top - 0.001])
    bars.append([-inner - 0.004, inner + 0.004, -d + 0.001, -d + 0.007, low - 0.01, top - 0.008])
    bars.append([-inner - 0.004, inner + 0.004, front - 0.03, front - 0.012, 0.002, low - thick + 0.002])
    if style == "cornice":
        bars.append([-w, w, -d + 0.001, d, height - 0.03, height])
    columns = [(-inner, inner)]
    if style == "divided":
        bars.append([-side / 2, side / 2, -d + 0.008, front - 0.006, low - 0.003, top - 0.003])
        columns = [(-inner, -side / 2), (side / 2, inner)]
    parts = [Part(boxes(bars, bevel=0.0015), finish)]
    supports = []
    rest: dict[str, list[Part]] = {}
    for k in range(rows):
        room = float(levels[k + 1] - levels[k] - thick)
        for x0, x1 in columns:
            share = float(np.clip(fill + rng.uniform(-0.3, 0.3), 0, 1))
            long = share * (x1 - x0 - 0.008)
            right = rng.uniform() < 0.5
            start = x0 + 0.004 if right else x1 - 0.004 - long
            deepest = min(0.24, depth - proud - 0.056)
            row = book_row(
                rng,
                start,
                start + long,
                front - 0.03,
                float(levels[k]) - 0.001,
                min(0.3, room - 0.02),
                deepest,
            )
            for part in row:
                rest.setdefault(part.variant, []).append(part)
            free = (start + long + 0.03, x1 - 0.02) if right else (x0 + 0.02, start - 0.03)
            if free[1] - free[0] > 0.1:
                supports.append(Support(*free, -d + 0.03, front - 0.03, float(levels[k]), room - 0.02))
    parts += [Part(merge([p.mesh for p in same]), "paper", variant) for variant, same in rest.items()]
    return Furniture("bookcase", parameters, tuple(parts), tuple(supports))


def sample_bookcase(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A bookcase with the parameters that are not fixed drawn at random."""
    return bookcase(**(draw(rng, SIZES, CHOICES) | fixed))
