"""The light that leaves a lamp: what a room sees of a bulb in a shade.

A bulb in a shade is light that paths find by chance alone: from most of the room it is hidden. A room is the same where
what is seen shines instead: the cloth by what goes through it, and its open ends by all that comes out of them. How
much that is follows from what the cloth reflects and lets through, and from form factors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gibench.generators.parts import FloatArray

REFLECTED, THROUGH = 0.55, 0.3
"""Shares of light that the cloth of a shade reflects inside, and lets through; the rest stays in it."""

POLISHED = 0.75
"""Share of light that the inside of a metal shade reflects."""


@dataclass(frozen=True)
class Leaving:
    """Shares of a bulb's flux that leave through the wall of its shade, its upper and its lower end."""

    wall: float
    above: float
    below: float


def out_of_shade(lower: float, upper: float, tall: float, z: float) -> Leaving:
    """Of a bulb at the height z in a cloth shade, a frustum with the radii `lower` at 0 and `upper` at `tall`, m.

    The bulb is a point that shines evenly; what the wall reflects is spread evenly over it. Form factors of coaxial
    disks are in closed form (Howell, A Catalog of Radiation Heat Transfer Configuration Factors, C-41).
    """
    above, below = (_cone(radius, height) for radius, height in ((upper, tall - z), (lower, z)))
    wall = math.pi * (lower + upper) * math.hypot(lower - upper, tall)
    area_above, area_below = math.pi * upper**2, math.pi * lower**2
    across = _disk_to_disk(lower, upper, tall)  # of what the lower end sends out, what meets the upper one
    to_below = area_below / wall * (1 - across)
    to_above = area_above / wall * (1 - across * area_below / area_above)
    met = (1 - above - below) / (1 - REFLECTED * (1 - to_above - to_below))
    return Leaving(THROUGH * met, above + REFLECTED * met * to_above, below + REFLECTED * met * to_below)


def out_of_bowl(opening: float, inside: float, depth: float) -> float:
    """Share that leaves a metal shade through its one opening, a disk of that radius, m.

    inside: area of the inner wall, m². depth: of the bulb behind the opening, m.
    """
    direct = _cone(opening, depth)
    out = math.pi * opening**2 / inside
    return direct + (1 - direct) * POLISHED * out / (1 - POLISHED * (1 - out))


def turned_area(profile: FloatArray) -> float:
    """Area of what a profile (P, 2) of (r, z) sweeps out around the z axis, m²."""
    steps = np.diff(profile, axis=0)
    return float(np.pi * ((profile[1:, 0] + profile[:-1, 0]) * np.hypot(*steps.T)).sum())


def _cone(radius: float, height: float) -> float:
    """Share of the sphere that a disk fills, seen from a point on its axis."""
    return 0.5 * (1 - height / math.hypot(radius, height))


def _disk_to_disk(first: float, second: float, apart: float) -> float:
    """Share of what one disk sends out that meets another with the same axis."""
    a, b = first / apart, second / apart
    s = 1 + (1 + b**2) / a**2
    return 0.5 * (s - math.sqrt(s**2 - 4 * (second / first) ** 2))
