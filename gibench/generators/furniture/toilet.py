"""Toilets with a cistern, standing on the floor."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.parts import FloatArray, Furniture, Mesh, Part
from gibench.generators.shapes import boxes, cylinder, merge, rounded_box, skin, stacked, superellipse

SIZES = {
    "width": Size(0.38, 0.35, 0.42, 0.04),
    "depth": Size(0.68, 0.60, 0.74, 0.04),
    "height": Size(0.80, 0.72, 0.88, 0.04),
}
CHOICES = {"style": ("cistern", "slim")}


def toilet(*, width: float, depth: float, height: float, style: str) -> Furniture:
    """A toilet (m). style: a full cistern on the bowl, or a slim one of full height.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("toilet", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    tank = 0.17 if style == "cistern" else 0.1
    seat = 0.41
    front, back = d, -d + tank + 0.015
    length = front - back
    bowl_w = min(w - 0.004, 0.185)
    outline = _egg(bowl_w, length) + np.array([0, (front + back) / 2])

    def ring(share_x: float, share_y: float) -> FloatArray:
        # Drawn in towards a point two fifths from the back, as the foot of a bowl is.
        origin = np.array([0, back + 0.4 * length])
        return (outline - origin) * [share_x, share_y] + origin

    rim = seat - 0.025
    rows = [
        (ring(0.5, 0.6), 0),
        (ring(0.6, 0.72), 0),
        (ring(0.58, 0.7), 0.1),
        (ring(0.72, 0.78), 0.22),
        (ring(0.97, 0.97), rim - 0.06),
    ]
    rows += [
        (ring(0.985, 0.985), rim - 0.02),
        (ring(0.98, 0.985), rim),
        (ring(0.7, 0.75), rim),
        (ring(0.66, 0.72), rim - 0.02),
    ]
    rows += [(ring(0.55, 0.6), rim - 0.12), (ring(0.3, 0.3), rim - 0.2), (ring(0.2, 0.2), rim - 0.2)]
    bowl = stacked([r for r, _ in rows], [z for _, z in rows])
    tall = boxes([-0.11, 0.11, -d + 0.03, back + 0.1, 0.001, rim - 0.05], bevel=0.03)
    tank_low = rim - 0.005 if style == "cistern" else 0.0
    cistern = rounded_box(
        (-w + 0.006, w - 0.006, -d + 0.004, -d + tank - 0.006, tank_low, height - 0.03), 0.025, arc=3, flat=1
    )
    cover = rounded_box((-w, w, -d, -d + tank, height - 0.037, height - 0.004), 0.012, arc=2, flat=1)
    button = cylinder(0.025, height - 0.012, height, bevel=0.002, centre=(0.0, -d + tank / 2))
    bridge = boxes([-0.1, 0.1, -d + 0.02, back + 0.06, rim - 0.08, rim - 0.002], bevel=0.012)
    ceramic = [bowl, tall, cistern, cover, bridge]
    parts = [Part(merge(ceramic), "ceramic"), Part(button, "chrome")]
    lid = [
        (ring(0.5, 0.5), 0.02),
        (ring(0.985, 0.985), 0.02),
        (ring(1, 1), 0.026),
        (ring(1, 1), 0.034),
        (ring(0.96, 0.97), 0.042),
        (ring(0.3, 0.3), 0.044),
    ]
    cover_parts = [
        stacked([r for r, _ in lid], [rim + z for _, z in lid]),
        _ring_seat(ring(0.995, 0.995), ring(0.7, 0.75), rim - 0.001, rim + 0.0185),
        boxes([-0.09, 0.09, back - 0.006, back + 0.05, rim - 0.004, rim + 0.03], bevel=0.008),
    ]
    parts.append(Part(merge(cover_parts), "ceramic", "seat"))
    return Furniture("toilet", parameters, tuple(parts))


def _egg(half_width: float, length: float) -> FloatArray:
    """(48, 2) outline of a toilet bowl around the origin: an ellipse to the front, squarer at the back."""
    front = superellipse(half_width, 0.6 * length, 2.0, 48)
    back = superellipse(half_width, 0.4 * length, 3.2, 48)
    return np.where(front[:, 1:] >= 0, front, back) - [0, 0.1 * length]


def _ring_seat(outer: FloatArray, inner: FloatArray, z0: float, z1: float) -> Mesh:
    """A ring between two outlines (N, 2) with eased edges."""
    loops = [(0.0, z0), (0.0, z1 - 0.005), (0.08, z1), (1 - 0.08, z1), (1.0, z1 - 0.005), (1.0, z0)]
    rings = [np.column_stack([outer + t * (inner - outer), np.full(len(outer), z)]) for t, z in loops]
    return skin(rings, creases=[0, 1, 2, 3, 4, 5], closed=True)


def sample_toilet(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A toilet with the parameters that are not fixed drawn at random."""
    return toilet(**(draw(rng, SIZES, CHOICES) | fixed))
