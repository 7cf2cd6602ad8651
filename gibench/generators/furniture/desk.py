"""Desks: on four legs, on metal frames, or with a pedestal of drawers."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import EMBED, HANDLES, fronts, grid_panels, handles, legs
from gibench.generators.parts import Furniture, Part, Support
from gibench.generators.shapes import boxes, frame, merge, rotate_y, rotate_z, translate

SIZES = {
    "width": Size(1.39, 1.00, 1.90),
    "depth": Size(0.62, 0.50, 0.80),
    "height": Size(0.79, 0.72, 0.84, 0.03),
}
CHOICES = {
    "style": ("legs", "frames", "pedestal"),
    "finish": ("wood", "wood", "lacquer"),
    "handle": tuple(HANDLES),
}


def desk(*, width: float, depth: float, height: float, style: str, finish: str, handle: str) -> Furniture:
    """A desk (m) to sit at from the front. style: what it stands on; finish: slot of its boards; handle: of
    drawers.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("desk", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    thick = 0.028
    under = height - thick
    parts = [Part(boxes([-w, w, -d, d, under, height], bevel=0.004), finish)]
    if style == "legs":
        x, y = w - 0.06, d - 0.06
        parts.append(Part(legs("tapered", x, y, under + EMBED, 0.05), finish))
        drawers = grid_panels(-x + 0.04, x - 0.04, under - 0.095, under - 0.004, 2, 1)
        parts.append(Part(boxes([[-x, x, -y, y - 0.005, under - 0.1, under + 0.001]], bevel=0.002), finish))
        parts.append(Part(fronts(drawers, y + 0.012), finish, "front"))
        if handle != "none":
            places = [((a + b) / 2, (c + e) / 2) for a, b, c, e in drawers]
            parts.append(Part(handles(handle, places, y + 0.012), "metal"))
    elif style == "frames":
        loop = frame(
            -d + 0.05, d - 0.05, 0, under + EMBED, [[0, -0.02], [0.025, -0.02], [0.025, 0.02], [0, 0.02]]
        )
        # The frame's plane is turned from x-y to y-z.
        upright = rotate_z(rotate_y(rotate_z(loop, np.pi / 2), np.pi / 2), np.pi)
        sides = [translate(upright, [s * (w - 0.12), 0, 0]) for s in (-1, 1)]
        bar = boxes(
            [-w + 0.12, w - 0.12, -d + 0.07, -d + 0.09, 0.45 * height, 0.45 * height + 0.2], bevel=0.002
        )
        parts += [Part(merge(sides), "metal"), Part(bar, finish)]
    else:
        face = d - 0.005 - HANDLES[handle]
        outer, box_width = w - 0.02, 0.4
        body = [outer - box_width, outer, -d + 0.02, face - 0.02, 0.03, under + EMBED]
        panel = [-w + 0.02, -w + 0.045, -d + 0.02, d - 0.03, 0, under + EMBED]
        modesty = [
            -w + 0.03,
            outer - box_width + 0.01,
            -d + 0.06,
            -d + 0.078,
            0.3 * height,
            under + EMBED / 2,
        ]
        plinth = [outer - box_width + 0.02, outer - 0.02, -d + 0.04, face - 0.05, 0, 0.04]
        parts.append(Part(boxes([body, panel, modesty, plinth], bevel=0.002), finish))
        drawers = grid_panels(outer - box_width, outer, 0.035, under - 0.004, 1, (1.6, 1.0, 1.0))
        parts.append(Part(fronts(drawers, face, thickness=0.0205), finish, "front"))
        if handle != "none":
            parts.append(
                Part(handles(handle, [((a + b) / 2, (c + e) / 2) for a, b, c, e in drawers], face), "metal")
            )
    support = Support(-w + 0.05, w - 0.05, -d + 0.04, d - 0.04, height)
    return Furniture("desk", parameters, tuple(parts), (support,))


def sample_desk(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A desk with the parameters that are not fixed drawn at random."""
    return desk(**(draw(rng, SIZES, CHOICES) | fixed))
