"""Plaster and limewash: a matt wall with trowel marks and soft clouds of tone."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.materials.color import colorize, lch, levels, ramp
from gibench.generators.materials.noise import band_noise
from gibench.generators.materials.roles import Role, draw, draw_hue, draw_seed
from gibench.generators.materials.surface import build_with, check_luminance, dielectric
from gibench.generators.parts import Material

_PIXELS = 256
_SIZE = (1.8, 1.8)
_STEPS = 128


def plaster(
    *, clouds: float, trowel: float, chroma: float, hue: float, luminance: float, seed: int
) -> Material:
    """A plastered surface, diffuse.

    clouds, trowel: relative contrast of the soft clouds and of the strokes. chroma, hue: Oklab.
    luminance: mean reflectance.
    """
    check_luminance("plaster", luminance)
    parameters = dict(locals())
    rng = np.random.default_rng(seed)
    shape = (_PIXELS, _PIXELS)
    strokes = band_noise(rng, shape, (5, 16)) + band_noise(rng, shape, (16, 5))
    grit = band_noise(rng, shape, (80, 80))
    value = 0.5 + 0.14 * (
        clouds * band_noise(rng, shape, (2, 2), slope=0.8) + trowel * (strokes + 0.5 * grit)
    )
    stops = lch([0.5 * 0.45, 0.5, 0.5 * 1.45], [1.15 * chroma, chroma, 0.85 * chroma], hue)
    pixels = colorize(levels(value, _STEPS), ramp(stops, _STEPS), luminance)
    return dielectric("plaster", parameters, pixels, size=_SIZE, alpha=0.0)


def sample_plaster(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """Whites and earth colours; calmer on ceilings."""
    strength = 0.35 if role.slot == "ceiling" else 1.0
    earth = rng.random() < 0.5
    drawn = {
        "clouds": round(strength * draw(rng, 0.08, 0.4), 4),
        "trowel": round(strength * draw(rng, 0.02, 0.14), 4),
        "chroma": draw(rng, 0.0, 0.01)
        if role.slot == "ceiling" or rng.random() < 0.6
        else draw(rng, 0.01, 0.04),
        "hue": draw(rng, 0.7, 1.7) if earth else draw_hue(rng),
        "luminance": role.draw_luminance(rng),
        "seed": draw_seed(rng),
    }
    return build_with(plaster, drawn, fixed)
