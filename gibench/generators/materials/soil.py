"""Potting soil: dark crumbs with a few light specks."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.materials.color import colorize, lch, levels, ramp
from gibench.generators.materials.noise import band_noise, smoothstep
from gibench.generators.materials.roles import Role, draw, draw_seed
from gibench.generators.materials.surface import build_with, check_luminance, dielectric
from gibench.generators.parts import Material

_PIXELS = 128
_SIZE = (0.2, 0.2)
_STEPS = 64


def soil(*, warmth: float, specks: float, luminance: float, seed: int) -> Material:
    """Soil, diffuse.

    warmth: Oklab chroma towards orange. specks: in [0, 1], how many. luminance: mean reflectance.
    """
    check_luminance("soil", luminance)
    parameters = dict(locals())
    rng = np.random.default_rng(seed)
    shape = (_PIXELS, _PIXELS)
    crumbs = band_noise(rng, shape, (14, 14), slope=0.6)
    light = smoothstep(2.6 - specks, 2.9 - specks, band_noise(rng, shape, (28, 28)))
    value = 0.3 + 0.13 * crumbs + 0.6 * light
    stops = lch([0.02, 0.08, 0.35], [warmth, warmth, 0.4 * warmth], 1.0)
    pixels = colorize(levels(value, _STEPS), ramp(stops, _STEPS), luminance)
    return dielectric("soil", parameters, pixels, size=_SIZE, alpha=0.0)


def sample_soil(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """Peat to compost."""
    drawn = {
        "warmth": draw(rng, 0.02, 0.05),
        "specks": draw(rng, 0.0, 0.8),
        "luminance": role.draw_luminance(rng),
        "seed": draw_seed(rng),
    }
    return build_with(soil, drawn, fixed)
