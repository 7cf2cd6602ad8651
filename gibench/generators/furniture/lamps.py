"""Parts that lamps share: a bulb in its socket, the shade around it, and what of both glows."""

from __future__ import annotations

import math

import numpy as np

from gibench.generators.furniture.drawing import Size
from gibench.generators.furniture.lamp_light import out_of_shade
from gibench.generators.light_shapes import SHADE_SEGMENTS
from gibench.generators.parts import Light, Mesh, Part
from gibench.generators.shapes import cylinder, merge, revolve, rod, translate

BULB = {
    "lumens": Size(850.0, 450.0, 1600.0, 0.3),
    "kelvin": Size(3000.0, 2700.0, 6500.0, 0.2),
}
"""Luminous flux (lm) and colour temperature (K) of one household bulb."""

SHADES = {"drum": (1.0, 0.62), "cone": (0.5, 0.7), "empire": (0.72, 0.66)}
"""Of each style: the upper radius as a share of the lower one, and the height as a share of the lower
width."""

THICKNESS = 0.0015
"""Of the cloth of a shade, m."""

RECESS = 0.002
"""Of what glows behind the rim of a shade, m."""

_UP = (0.0, 0.0, 1.0)
_SKIN = 0.0005  # between a shade and what glows on it or in it (m)
_CLEAR = 0.003  # free space between a bulb and its socket (m); the light must not touch a mesh
_SOCKET = 0.045


def bulb(centre: tuple[float, float, float], radius: float) -> Light:
    """A spherical bulb that is seen (m), for `light.fed`."""
    return Light("bulb", "sphere", (radius,), centre, (0.0, 0.0, -1.0), 0.0, 0.0)


def shade(bottom: float, top: float, z0: float, z1: float, *, thickness: float = THICKNESS) -> Mesh:
    """A lamp shade open below and above: a wall with the outer radii `bottom` at z0 and `top` at z1 (m)."""
    wall = [[bottom, z0], [top, z1], [top - thickness, z1], [bottom - thickness, z0]]
    return revolve(wall, segments=SHADE_SEGMENTS, closed=True)


def within(radius: float) -> float:
    """Radius of the largest disk that keeps clear of the inside of a shade, whose wall has flat sides (m)."""
    return radius * math.cos(math.pi / SHADE_SEGMENTS) - _SKIN


def glow(name: str, radius: float, centre: tuple[float, float, float], up: bool, share: float) -> Light:
    """The open end of a shade (m), as bright as what leaves through it, a share of the bulb's flux; for `light.fed`."""
    return Light(name, "disk", (radius,), centre, (0.0, 0.0, 1.0 if up else -1.0), 0.0, 0.0, share)


def shaded_bulb(
    style: str,
    width: float,
    z1: float,
    *,
    hanging: bool,
    radius: float,
    metal: str,
    at: tuple[float, float] = (0.0, 0.0),
) -> tuple[list[Part], list[Light], float]:
    """A cloth shade with a bulb in it, of which nothing is seen: the cloth glows, and so do its open ends.

    style: of SHADES; width: across the shade's lower rim; z1: the upper rim. radius: of the bulb (m).
    hanging: the socket is above the bulb, otherwise below it. metal: slot of socket and shade holder.
    Returns the parts, the lights, for `light.fed`, and the height of the far end of the socket, where the stem joins
    (m).
    """
    share, tallness = SHADES[style]
    lower = width / 2
    upper, tall = share * lower, tallness * width
    z0 = z1 - tall
    z = z0 + (0.42 if hanging else 0.52) * tall
    near = radius + _CLEAR
    ends = (z + near, z + near + _SOCKET) if hanging else (z - near - _SOCKET, z - near)
    parts = [shade(lower, upper, z0, z1), cylinder(0.016, *ends, segments=16)]
    # Three thin arms hold the shade, at the far end of the socket.
    ring = min(ends[1] - 0.006, z1 - 0.006) if hanging else max(ends[0] + 0.006, z0 + 0.006)
    reach = lower + (upper - lower) * (ring - z0) / tall - 0.0008
    angles = np.pi / 6 + np.arange(3) * 2 * np.pi / 3
    outward = np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], 1)
    lift = np.array([0, 0, ring])
    arms = [rod(0.006 * out + lift, reach * out + lift, 0.0015, sides=6) for out in outward]
    offset = [*at, 0.0]
    shade_part = Part(translate(parts[0], offset), "lampshade")
    holder = Part(translate(merge([parts[1], *arms]), offset), metal)
    leaving = out_of_shade(lower, upper, tall, z - z0)
    wall = (lower + _SKIN, upper + _SKIN, tall)
    lights = [Light("shade", "shade", wall, (*at, (z0 + z1) / 2), _UP, 0.0, 0.0, leaving.wall, "lampshade")]
    for name, up, share in (("above", True, leaving.above), ("below", False, leaving.below)):
        height = z1 - RECESS if up else z0 + RECESS
        wide = within(lower + (upper - lower) * (height - z0) / tall - THICKNESS)
        lights.append(glow(name, wide, (*at, height), up, share))
    return [shade_part, holder], lights, ends[1] if hanging else ends[0]
