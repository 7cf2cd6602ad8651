"""Curtains in folds on a rod."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.parts import FloatArray, Furniture, Mesh, Part
from gibench.generators.shapes import boxes, fit, merge, repeat_at, rod, rotate_y, sheet, sphere, torus

SIZES = {
    "width": Size(2.20, 0.60, 5.50, 0.2),
    "depth": Size(0.13, 0.10, 0.18, 0.08),
    "height": Size(2.25, 1.00, 3.60, 0.05),
    "closed": Size(0.40, 0.20, 1.0, 0.25),
}
CHOICES = {
    "style": ("pair", "single"),
    "metal": ("metal", "brass", "chrome", "wood"),
    "arrangement": range(1000),
}
_FOLD = 0.11  # from fold to fold where the cloth hangs (m)


def curtain(
    *, width: float, depth: float, height: float, closed: float, style: str, metal: str, arrangement: int
) -> Furniture:
    """Curtains on a rod `width` m long whose top is `height` m above their hem, `depth` m from the wall to
    the front.

    closed: share of the width that cloth covers. style: pair hangs at both ends, single at the left. metal:
    slot of the rod. arrangement: which folds. Raises FurnitureError for a size out of SIZES or an option
    out of CHOICES.
    """
    parameters = checked("curtain", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    radius, knob = 0.012, 0.02
    z = height - knob
    y = d - 0.05
    bar = rod([-w + 2 * knob - 0.004, y, z], [w - 2 * knob + 0.004, y, z], radius, sides=16)
    knobs = [sphere(knob, (s * (w - knob), y, z), segments=16) for s in (-1, 1)]
    brackets = [
        [s * (w - 0.09) - 0.008, s * (w - 0.09) + 0.008, -d, y, z - 0.008, z + 0.008] for s in (-1, 1)
    ]
    brackets += [
        [s * (w - 0.09) - 0.02, s * (w - 0.09) + 0.02, -d + 0.001, -d + 0.008, z - 0.03, z + 0.019]
        for s in (-1, 1)
    ]
    x0, x1 = -w + 2 * knob + 0.005, w - 2 * knob - 0.005
    cover = closed * (x1 - x0)
    stretches = [(x0, x0 + cover / 2), (x1 - cover / 2, x1)] if style == "pair" else [(x1 - cover, x1)]
    rng = np.random.default_rng(arrangement)
    panels, rings = [], []
    for a, b in stretches:
        folds = max(3, round((b - a) / _FOLD))
        panels.append(_panel(a, b, y, d, z - 0.03, folds, rng.uniform(0, 2 * np.pi, 3)))
        rings += [[x, y, z - 0.005] for x in np.linspace(a + 0.02, b - 0.02, folds + 1)]
    ring = rotate_y(torus(0.018, 0.0022, segments=10, sides=4), np.pi / 2)
    return Furniture(
        "curtain",
        parameters,
        (
            Part(merge([bar, *knobs]), metal),
            Part(boxes(brackets, bevel=0.002), metal),
            Part(repeat_at(ring, rings), metal),
            Part(merge(panels), "curtain"),
        ),
        mount="wall",
    )


def _panel(x0: float, x1: float, y: float, front: float, top: float, folds: int, phases: FloatArray) -> Mesh:
    """One curtain from z = 0 to `top` over [x0, x1] whose folds touch y = front and stay off the wall at y
    = -front."""
    t = np.linspace(0, 1, 8 * folds + 1)[:, None]
    drop = np.linspace(0, 1, 9)[None]  # 0 at the top
    fullness = 0.55 + 0.45 * drop**0.7
    turn = 2 * np.pi * folds * t + 0.5 * drop * np.sin(2 * np.pi * t + phases[0])
    reach = front - y - 0.002
    wave = np.sin(turn) * (0.8 + 0.2 * np.sin(5 * np.pi * t + phases[1]))
    depths = y + reach * (fullness * wave + 0.12 * drop * np.sin(3 * np.pi * t + phases[2]))
    # Each fold leans a little over the next, as cloth does.
    across = x0 + (x1 - x0) * t - 0.014 * fullness * np.sin(2 * turn)
    grid = np.stack(np.broadcast_arrays(across, depths, top * (1 - drop)), -1)
    mesh = sheet(grid[:, ::-1], 0.003)
    low = mesh.vertices.min(0)
    return fit(mesh, [x0, max(low[1], 0.012 - front), 0.0], [x1, front, top])


def sample_curtain(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """Curtains with the parameters that are not fixed drawn at random."""
    return curtain(**(draw(rng, SIZES, CHOICES) | fixed))
