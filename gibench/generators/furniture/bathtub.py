"""Bathtubs: built in behind panels, or free-standing ovals."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.taps import tap
from gibench.generators.parts import FloatArray, Furniture, Part
from gibench.generators.shapes import cylinder, frame, loft, merge, rounded_rectangle, stacked, superellipse

SIZES = {
    "width": Size(1.70, 1.45, 1.95, 0.05),
    "depth": Size(0.76, 0.68, 0.95, 0.05),
    "rim": Size(0.57, 0.48, 0.64, 0.05),
}
CHOICES = {"style": ("panelled", "tiled", "oval")}


def bathtub(*, width: float, depth: float, rim: float, style: str) -> Furniture:
    """A bathtub, its long side along x, `rim` m high; the tap on the back rim stands higher.

    style: what it is clad with (panelled: enamelled, tiled: stone), or a free-standing oval, without a tap.
    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("bathtub", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    floor = 0.14
    if style == "oval":
        return Furniture("bathtub", parameters, tuple(_oval(w, d, rim, floor)))
    side, back = 0.065, 0.12
    # Of the hollow: how far it is drawn in from the rim's inner edge, its height, its corner radius.
    steps = (
        (0.0, rim - 0.008, 0.11),
        (0.03, 0.65 * rim, 0.13),
        (0.07, floor + 0.08, 0.14),
        (0.1, floor + 0.02, 0.14),
        (0.15, floor, 0.12),
    )
    x0, x1, y0, y1 = -w + side, w - side, -d + back, d - side

    def ring(inset: float, radius: float) -> FloatArray:
        return rounded_rectangle(
            x0 + 1.6 * inset, x1 - inset, y0 + 0.6 * inset, y1 - 0.6 * inset, radius, segments=5
        )

    shell = 0.008
    outlines, heights = [ring(0.2, 0.05)], [floor - shell]
    for inset, z, radius in steps[::-1]:
        outlines.append(ring(inset - shell, radius + shell))
        heights.append(min(z - shell, rim - 0.036))
    for edge, z in ((0.0, rim - 0.036), (0.0, rim - 0.008), (0.008, rim)):
        outlines.append(rounded_rectangle(-w + edge, w - edge, -d + edge, d - edge, 0.018, segments=5))
        heights.append(z)
    outlines.append(ring(-0.01, 0.12))
    heights.append(rim)
    for inset, z, radius in steps:
        outlines.append(ring(inset, radius))
        heights.append(z)
    outlines.append(ring(0.2, 0.05))
    heights.append(floor)
    parts = [Part(stacked(outlines, heights), "enamel")]
    wall: list[list[float]] = [[0, 0], [0.02, 0], [0.02, rim - 0.034], [0, rim - 0.034]]
    skirt = frame(-w + 0.014, w - 0.014, -d + 0.014, d - 0.014, wall)
    parts.append(Part(skirt, "stone" if style == "tiled" else "enamel", "skirt"))
    drain = cylinder(0.03, floor - 0.002, floor + 0.003, bevel=0.001, centre=(0.55 * x1, (y0 + y1) / 2))
    spout = tap(0.16, 0.15, at=(0.0, -d + 0.055, rim), gooseneck=False)
    parts.append(Part(merge([drain, spout]), "chrome"))
    return Furniture("bathtub", parameters, tuple(parts))


def _oval(w: float, d: float, rim: float, floor: float) -> list[Part]:
    edge = 0.03
    # (share of the half-width, share of the half-depth, z) of the outside upwards, then of the hollow downwards.
    outside = [
        (0, 0, 0),
        (0.64, 0.56, 0),
        (0.68, 0.6, 0.015),
        (0.76, 0.74, 0.3 * rim),
        (0.88, 0.87, 0.65 * rim),
    ]
    outside += [
        (0.995, 0.99, rim - 0.018),
        (1, 1, rim - 0.01),
        (0.997, 0.995, rim - 0.002),
        (0.985, 0.97, rim),
    ]
    x, y = 1 - edge / w, 1 - edge / d
    hollow = [
        (x + 0.005, y + 0.01, rim),
        (x, y, rim - 0.006),
        (0.84 * x, 0.85 * y, 0.65 * rim),
        (0.76 * x, 0.76 * y, floor + 0.09),
    ]
    hollow += [(0.68 * x, 0.66 * y, floor + 0.02), (0.56 * x, 0.52 * y, floor), (0, 0, floor)]
    rows = [[a, b, 0, 0, z] for a, b, z in (*outside, *hollow)]
    drain = cylinder(0.03, floor - 0.002, floor + 0.003, bevel=0.001, centre=(0.3 * w, 0.0))
    return [Part(loft(superellipse(w, d, 2.3, 64), rows), "enamel"), Part(drain, "chrome")]


def sample_bathtub(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A bathtub with the parameters that are not fixed drawn at random."""
    return bathtub(**(draw(rng, SIZES, CHOICES) | fixed))
