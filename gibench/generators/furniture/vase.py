"""Vases, thin-walled and open."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import fillet, revolve

SIZES = {"width": Size(0.13, 0.08, 0.22, 0.15), "height": Size(0.26, 0.15, 0.42, 0.18)}
CHOICES = {
    "style": ("amphora", "cylinder", "flask", "trumpet"),
    "material": ("ceramic", "ceramic", "glassware", "brass"),
}
_LINES = {
    # (radius, height), both as shares, from the foot to the lip
    "amphora": [(0.55, 0), (1.0, 0.55), (0.5, 0.85), (0.62, 1.0)],
    "cylinder": [(0.92, 0), (1.0, 0.5), (0.94, 1.0)],
    "flask": [(0.8, 0), (1.0, 0.22), (0.42, 0.55), (0.3, 0.8), (0.4, 1.0)],
    "trumpet": [(0.6, 0), (0.55, 0.35), (0.65, 0.7), (1.0, 1.0)],
}


def vase(*, width: float, height: float, style: str, material: str) -> Furniture:
    """A vase (m). material: its slot. Raises FurnitureError for a size out of SIZES or an option out of
    CHOICES."""
    parameters = checked("vase", locals(), SIZES, CHOICES)
    wall = 0.004
    r = width / 2
    outside = np.array(_LINES[style]) * [r, height]
    soft = [0.006, *[2 * r] * (len(outside) - 2), 0.0012]
    line = fillet(np.concatenate([[[0, 0]], outside, [[0, height]]]), [0, *soft, 0], segments=7)[1:-1]
    line = line[line[:, 1] < height - 0.0005]
    line[:, 0] *= r / line[:, 0].max() if style != "trumpet" else 1.0
    lip = max(outside[-1, 0] - 0.001, line[-1, 0] - 0.002)
    inner = line[line[:, 1] > wall][::-1] - [wall, 0]
    loop = np.concatenate(
        [[[0, 0]], line, [[lip, height]], [[lip - wall + 0.002, height]], inner, [[0, wall]]]
    )
    loop[:, 0] *= r / loop[:, 0].max()
    return Furniture("vase", parameters, (Part(revolve(loop, segments=32), material),), mount="surface")


def sample_vase(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A vase with the parameters that are not fixed drawn at random."""
    return vase(**(draw(rng, SIZES, CHOICES) | fixed))
