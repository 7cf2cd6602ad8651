"""Computer keyboards."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.parts import Furniture, Mesh, Part
from gibench.generators.shapes import boxes, extrude, merge, rounded_rectangle, translate

SIZES = {
    "width": Size(0.43, 0.28, 0.46, 0.08),
    "depth": Size(0.13, 0.11, 0.15, 0.06),
    "height": Size(0.022, 0.012, 0.034, 0.2),
}
CHOICES = {"style": ("flat", "keypad"), "case": ("plastic", "metal")}


def key_rows(width: float, depth: float, *, rows: int, columns: int, height: float) -> Mesh:
    """Rows of keys around the origin on z = 0, the one nearest +y with a space bar (m)."""
    pitch_x, pitch_y = width / columns, depth / rows
    gap = 0.09 * min(pitch_x, pitch_y)
    keys = []
    for row in range(rows):
        y0 = -depth / 2 + row * pitch_y + gap
        y1 = y0 + pitch_y - 2 * gap
        edges = np.arange(columns + 1.0)
        if row == rows - 1 and columns > 8:
            edges = np.array([0, 1, 2, 3.25, *range(columns - 4, columns + 1)])
        elif row > 0 and columns > 8:
            edges[1:-1] += 0.25 * row  # keyboards are staggered
        x = -width / 2 + pitch_x * edges
        keys += [[a + gap, b - gap, y0, y1, 0, height] for a, b in pairwise(x)]
    # Seen by someone who sits at +y and looks towards -y, left is +x.
    extents = np.array(keys)
    extents[:, :2] = -extents[:, 1::-1]
    return boxes(extents, bevel=0.0006)


def keyboard(*, width: float, depth: float, height: float, style: str, case: str) -> Furniture:
    """A keyboard (m) for someone at +y. style: keypad adds a block of digits; case: slot of its housing.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("keyboard", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    cap = 0.35 * height
    body = extrude(rounded_rectangle(-w, w, -d, d, 0.006), 0, height - cap, bevel=0.0015)
    margin = 0.007
    usable = width - 2 * margin
    keys = []
    shares = ((0.0, 1.0, 15),) if style == "flat" else ((0.0, 0.78, 15), (0.81, 1.0, 4))
    for start, stop, columns in shares:
        block = key_rows(
            (stop - start) * usable, depth - 2 * margin, rows=5, columns=columns, height=cap + 0.0005
        )
        keys.append(translate(block, [w - margin - (start + stop) / 2 * usable, 0, height - cap - 0.0005]))
    return Furniture(
        "keyboard", parameters, (Part(body, case), Part(merge(keys), "plastic", "keys")), mount="surface"
    )


def sample_keyboard(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A keyboard with the parameters that are not fixed drawn at random."""
    return keyboard(**(draw(rng, SIZES, CHOICES) | fixed))
