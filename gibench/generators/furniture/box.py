"""Storage boxes: with a lid, a woven basket, or a wooden crate."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import boxes, rounded_rectangle, stacked

SIZES = {
    "width": Size(0.30, 0.15, 0.45, 0.15),
    "depth": Size(0.22, 0.12, 0.34, 0.12),
    "height": Size(0.16, 0.08, 0.28, 0.15),
}
CHOICES = {"style": ("lidded", "basket", "crate"), "finish": ("paper", "lacquer", "fabric")}


def box(*, width: float, depth: float, height: float, style: str, finish: str) -> Furniture:
    """A storage box (m). finish: slot of a lidded one; baskets are of rattan, crates of wood.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("box", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    if style == "lidded":
        lid = 0.25 * height
        bars = [[-w + 0.003, w - 0.003, -d + 0.003, d - 0.003, 0, height - 0.003]]
        body = Part(boxes(bars, bevel=0.002), finish)
        cover = Part(boxes([-w, w, -d, d, height - lid, height], bevel=0.002), finish, "lid")
        return Furniture("box", parameters, (body, cover), mount="surface")
    if style == "crate":
        slat = (height - 0.012) / 3
        t = 0.009
        bars = [[-w + t - 0.003, w - t + 0.003, -d + t - 0.002, d - t + 0.002, 0.0015, 0.008]]
        for k in range(3):
            z = (0.0 if k == 0 else k * (slat + 0.006), k * (slat + 0.006) + slat)
            bars += [[-w, w, s * (d - t / 2) - t / 2, s * (d - t / 2) + t / 2, *z] for s in (-1, 1)]
            bars += [
                [
                    s * (w - t / 2 - 0.001) - t / 2,
                    s * (w - t / 2 - 0.001) + t / 2,
                    -d + t - 0.001,
                    d - t + 0.001,
                    z[0] + 0.001,
                    z[1] - 0.001,
                ]
                for s in (-1, 1)
            ]
        bars += [
            [
                s * (w - t - 0.009) - 0.01,
                s * (w - t - 0.009) + 0.01,
                u * (d - t - 0.009) - 0.01,
                u * (d - t - 0.009) + 0.01,
                0.002,
                height - 0.003,
            ]
            for s in (-1, 1)
            for u in (-1, 1)
        ]
        return Furniture("box", parameters, (Part(boxes(bars, bevel=0.001), "wood"),), mount="surface")
    wall = 0.008
    rows = [
        (0.05, 0.0),
        (0.02, 0.0),
        (0.012, 0.006),
        (0.0, height - 0.012),
        (0.0, height - 0.004),
        (0.003, height),
    ]
    rows += [
        (wall - 0.003, height),
        (wall, height - 0.004),
        (wall + 0.012, 0.014),
        (wall + 0.02, 0.009),
        (0.05, 0.009),
    ]
    outlines = [rounded_rectangle(-w + e, w - e, -d + e, d - e, 0.03) for e, _ in rows]
    basket = stacked(outlines, [z for _, z in rows])
    return Furniture("box", parameters, (Part(basket, "rattan"),), mount="surface")


def sample_box(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A box with the parameters that are not fixed drawn at random."""
    return box(**(draw(rng, SIZES, CHOICES) | fixed))
