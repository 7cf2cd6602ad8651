"""Wall mirrors: rectangular, round, or with an arched top."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import upright
from gibench.generators.parts import FloatArray, Furniture, Part
from gibench.generators.shapes import extrude, rectangle, superellipse

SIZES = {
    "width": Size(0.62, 0.40, 1.60, 0.15),
    "height": Size(0.85, 0.40, 1.80, 0.15),
    "depth": Size(0.03, 0.02, 0.05, 0.15),
    "frame_width": Size(0.022, 0.008, 0.05, 0.3),
}
CHOICES = {"style": ("rectangle", "oval", "arch"), "finish": ("wood", "lacquer", "brass", "metal")}


def mirror(
    *, width: float, height: float, depth: float, frame_width: float, style: str, finish: str
) -> Furniture:
    """A mirror to hang on a wall (m). style: its outline (an oval of equal sides is round); finish: slot of
    its frame.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("mirror", locals(), SIZES, CHOICES)
    outer = _outline(style, width, height, 0.0)
    inner = _outline(style, width, height, frame_width)
    frame = extrude(outer, 0, depth, holes=(inner,), bevel=0.002)
    glass = extrude(
        _outline(style, width, height, frame_width - 0.003), 0.3 * depth, 0.55 * depth, bevel=0.0005
    )
    parts = (Part(upright(frame, depth), finish), Part(upright(glass, depth), "mirror"))
    return Furniture("mirror", parameters, parts, mount="wall")


def _outline(style: str, width: float, height: float, inset: float) -> FloatArray:
    w = width / 2 - inset
    if style == "oval":
        return superellipse(w, height / 2 - inset, 2.0, 64) + np.array([0, height / 2])
    corners = rectangle(-w, w, inset, height - inset)
    if style == "rectangle":
        return corners
    rise = 0.95 * min(width / 2, 0.6 * height) - inset
    arch = superellipse(w, rise, 2.0, 64)
    top = arch[arch[:, 1] >= 0]
    return np.concatenate([corners[:2], top + np.array([0, height - inset - rise])])


def sample_mirror(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A mirror with the parameters that are not fixed drawn at random."""
    return mirror(**(draw(rng, SIZES, CHOICES) | fixed))
