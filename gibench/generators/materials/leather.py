"""Leather: the pebbled grain of a tanned hide, with a satin finish."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.materials.cells import cells
from gibench.generators.materials.color import colorize, lch, levels, ramp
from gibench.generators.materials.noise import band_noise, smoothstep
from gibench.generators.materials.roles import Role, draw, draw_hue, draw_seed
from gibench.generators.materials.surface import build_with, check_luminance, dielectric
from gibench.generators.parts import Material

_PIXELS = 192
_GRID = 40
_STEPS = 96


def leather(
    *, pebble: float, crease: float, chroma: float, hue: float, luminance: float, alpha: float, seed: int
) -> Material:
    """A leather surface.

    pebble: spacing of the grain, m. crease: in [0, 1], darkness of the furrows between pebbles. chroma, hue:
    Oklab. luminance: mean reflectance. alpha: GGX roughness of the finish.
    """
    check_luminance("leather", luminance)
    parameters = dict(locals())
    rng = np.random.default_rng(seed)
    shape = (_PIXELS, _PIXELS)
    grain = cells(rng, shape, _GRID)
    furrow = 1 - smoothstep(0.02, 0.22, grain.second - grain.nearest)
    tone = rng.normal(0, 0.03, _GRID * _GRID)[grain.number] + 0.06 * band_noise(rng, shape, (3, 3), slope=0.8)
    value = 0.75 + tone - 0.5 * crease * furrow
    stops = lch([0.1, 0.3, 0.5], [chroma, 1.1 * chroma, chroma], [hue - 0.08, hue, hue + 0.05])
    pixels = colorize(levels(value, _STEPS), ramp(stops, _STEPS), luminance)
    return dielectric("leather", parameters, pixels, size=(pebble * _GRID, pebble * _GRID), alpha=alpha)


def sample_leather(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """Mostly tan to brown, else grey or a muted colour."""
    brown = rng.random() < 0.65
    drawn = {
        "pebble": draw(rng, 0.0025, 0.005),
        "crease": draw(rng, 0.2, 0.7),
        "chroma": draw(rng, 0.03, 0.07) if brown else draw(rng, 0.0, 0.04),
        "hue": draw(rng, 0.85, 1.25) if brown else draw_hue(rng),
        "luminance": role.draw_luminance(rng),
        "alpha": role.draw_alpha(rng),
        "seed": draw_seed(rng),
    }
    return build_with(leather, drawn, fixed)
