"""Framed pictures, with or without a mount of white card around the image."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import upright
from gibench.generators.parts import Furniture, Mesh, Part
from gibench.generators.shapes import box, fillet, frame

SIZES = {
    "width": Size(0.60, 0.30, 1.20, 0.25),
    "height": Size(0.52, 0.30, 1.00, 0.22),
    "depth": Size(0.028, 0.018, 0.05, 0.15),
    "frame_width": Size(0.028, 0.012, 0.05, 0.25),
}
CHOICES = {
    "style": ("flat", "moulded", "canvas"),
    "mount_share": (0.0, 0.0, 0.1, 0.18),
    "finish": ("wood", "lacquer", "brass", "metal"),
}


def picture(
    *,
    width: float,
    height: float,
    depth: float,
    frame_width: float,
    style: str,
    mount_share: float,
    finish: str,
) -> Furniture:
    """A picture to hang on a wall (m). style: of its frame; canvas: stretched, without a frame.

    mount_share: width of the card around the image as a share of the shorter side. finish: slot of the frame.
    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("picture", locals(), SIZES, CHOICES)
    if style == "canvas":
        image = box(-width / 2, width / 2, -depth / 2, depth / 2, 0, height, bevel=0.003, grain=0)
        return Furniture(
            "picture", parameters, (Part(_from_corner(image, width / 2, 0), "picture"),), mount="wall"
        )
    deep, wide = depth, frame_width
    profile = {
        "flat": fillet(
            [[0, 0], [wide, 0], [wide, deep], [0, deep]], [0, 0, 0.0015, 0.0015], segments=2, closed=True
        ),
        "moulded": fillet(
            [
                [0, 0],
                [wide, 0],
                [wide, 0.45 * deep],
                [0.7 * wide, 0.55 * deep],
                [0.45 * wide, deep],
                [0, 0.8 * deep],
            ],
            [0, 0, 0.001, 0.3 * wide, 0.3 * wide, 0.002],
            closed=True,
        ),
    }[style]
    profile[:, 1] *= deep / profile[:, 1].max()
    parts = [Part(upright(frame(-width / 2, width / 2, 0, height, profile), depth), finish)]
    border = mount_share * min(width, height)
    x, low, high = width / 2 - wide + 0.002, wide - 0.002, height - wide + 0.002
    back = -depth / 2 + 0.003
    if border:
        card = box(-x, x, back, back + 0.003, low, high, bevel=0.0005)
        parts.append(Part(card, "paper", "mount"))
        x, low, high, back = x - border, low + border, high - border, back + 0.002
    image = box(-x, x, back, back + 0.003, low, high, bevel=0.0005, grain=0)
    parts.append(Part(_from_corner(image, x, low), "picture"))
    return Furniture("picture", parameters, tuple(parts), mount="wall")


def _from_corner(image: Mesh, x: float, z: float) -> Mesh:
    """The image with UVs that start at its lower left corner as seen from the front, u rightward and v up."""
    return Mesh(image.vertices, image.faces, image.normals, [x, -z] - image.uvs)


def sample_picture(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A picture with the parameters that are not fixed drawn at random."""
    return picture(**(draw(rng, SIZES, CHOICES) | fixed))
