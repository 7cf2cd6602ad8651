"""Bowls, some with fruit."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import merge, revolve, sphere

SIZES = {"width": Size(0.26, 0.14, 0.36, 0.15), "height": Size(0.09, 0.055, 0.14, 0.12)}
CHOICES = {
    "style": ("round", "flat", "footed"),
    "material": ("ceramic", "ceramic", "wood", "metal"),
    "fruit": (0, 0, 3, 5),
}


def bowl(*, width: float, height: float, style: str, material: str, fruit: int) -> Furniture:
    """A bowl (m). material: its slot; fruit: how many lie in it, below its rim.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("bowl", locals(), SIZES, CHOICES)
    r, wall = width / 2, 0.0045
    foot = 0.42 * r
    low = 0.16 * height if style == "footed" else 0.003
    bend = {"round": 0.75, "flat": 0.55, "footed": 0.8}[style]
    turn = np.linspace(0, 1, 9)[1:]
    rise = low + (height - low) * turn ** (1 / bend)
    spread = foot + (r - foot) * np.sin(0.5 * np.pi * turn) ** bend
    base = [[0, 0], [foot - 0.001, 0], [foot, low if style == "footed" else 0.002]]
    outside = np.concatenate([base, np.stack([spread, rise], 1)])
    inside = np.stack([spread - wall, np.maximum(rise, low + wall)], 1)[::-1]
    inside = inside[inside[:, 1] > low + wall + 1e-4]
    floor = [[foot - 0.004, low + wall], [0, low + wall]]
    profile = np.concatenate([outside, inside, floor])
    parts = [Part(revolve(profile, segments=40), material)]
    size = min(0.3 * r, 0.38 * (height - low))
    if fruit:
        circle = 0.0 if fruit == 1 else 1.25 * size / np.sin(np.pi / fruit)
        level = low + wall + size + 0.25 * max(0.0, circle - foot)
        angles = np.arange(fruit) * 2 * np.pi / fruit
        fruits = [sphere(size, (circle * np.cos(a), circle * np.sin(a), level), segments=16) for a in angles]
        parts.append(Part(merge(fruits), "leaf", "fruit"))
    return Furniture("bowl", parameters, tuple(parts), mount="surface")


def sample_bowl(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A bowl with the parameters that are not fixed drawn at random."""
    return bowl(**(draw(rng, SIZES, CHOICES) | fixed))
