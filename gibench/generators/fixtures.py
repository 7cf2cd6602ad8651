"""Fixtures of the building: ceiling panels, downlights, the tiles above a worktop."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.openings import HAIR
from gibench.generators.parts import Furniture, Light, Part
from gibench.generators.shapes import boxes, revolve

DOWN = (0.0, 0.0, -1.0)


def ceiling_panel(*, width: float, depth: float, height: float, lumens: float, kelvin: float) -> Furniture:
    """A flat luminous panel in a frame, `width` × `depth` m and `height` m thick, below the ceiling at z = 0."""
    w, d, rim = width / 2, depth / 2, 0.012
    frame = [
        [-w, w, -d, -d + rim, -height, -0.004],
        [-w, w, d - rim, d, -height, -0.004],
        [-w, -w + rim, -d + rim / 2, d - rim / 2, -height + HAIR, -0.004],
        [w - rim, w, -d + rim / 2, d - rim / 2, -height + HAIR, -0.004],
        [-w + HAIR, w - HAIR, -d + HAIR, d - HAIR, -height + 0.006, 0.0],
    ]
    inner = (width - 2 * rim - 0.004, depth - 2 * rim - 0.004)
    light = Light("panel", "rectangle", inner, (0.0, 0.0, -height + 0.004), DOWN, lumens, kelvin)
    parameters = {"width": width, "depth": depth, "height": height, "lumens": lumens, "kelvin": kelvin}
    body = Part(boxes(frame, bevel=0.001), "plastic", "fixture")
    return Furniture("ceiling_panel", parameters, (body,), (), (light,), mount="ceiling")


def sample_ceiling_panel(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """Draw a square or long panel; lumens and kelvin are among `fixed`."""
    width, depth = ((0.6, 0.6), (1.2, 0.3), (0.45, 0.45), (1.2, 0.6), (0.9, 0.25))[int(rng.integers(5))]
    drawn = {"width": width, "depth": depth, "height": float(rng.uniform(0.02, 0.06))}
    return ceiling_panel(**{**drawn, **fixed})


def downlight(*, radius: float, height: float, lumens: float, kelvin: float) -> Furniture:
    """A small round light with a rim of 8 mm; `radius` is that of what glows, the ceiling is at z = 0 (m)."""
    outer, lip = radius + 0.008, 0.003
    # Behind a deeper rim, a few paths by way of its metal would hold much of the light.
    glow = -height + lip
    profile = [[0.0, glow], [radius, glow], [radius + lip, -height]]
    profile += [[outer - lip, -height], [outer, -height + lip], [outer, 0.0], [0.0, 0.0]]
    light = Light("disk", "disk", (radius - 0.002,), (0.0, 0.0, glow - 0.002), DOWN, lumens, kelvin)
    parameters = {"radius": radius, "height": height, "lumens": lumens, "kelvin": kelvin}
    body = Part(revolve(profile), "metal", "fixture")
    return Furniture("downlight", parameters, (body,), (), (light,), mount="ceiling")


def sample_downlight(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """Draw a downlight; lumens and kelvin are among `fixed`."""
    drawn = {"radius": float(rng.uniform(0.03, 0.06)), "height": float(rng.uniform(0.02, 0.05))}
    return downlight(**{**drawn, **fixed})


def splashback(*, width: float, height: float) -> Furniture:
    """A panel of tiles or glass that covers the wall above a worktop (m)."""
    body = Part(boxes([[-width / 2, width / 2, -0.004, 0.004, 0.0, height]], bevel=0.001), "splashback")
    return Furniture("splashback", {"width": width, "height": height}, (body,), mount="wall")
