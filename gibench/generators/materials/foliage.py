"""Leaves: green with paler veins and blotches, under a waxy coat."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.materials.color import colorize, lch, levels, ramp
from gibench.generators.materials.noise import band_noise, smoothstep
from gibench.generators.materials.roles import Role, draw, draw_seed
from gibench.generators.materials.surface import build_with, check_luminance, dielectric
from gibench.generators.parts import Material

_PIXELS = 128
_SIZE = (0.24, 0.24)
_STEPS = 64


def foliage(
    *, hue: float, chroma: float, veins: float, luminance: float, alpha: float, seed: int
) -> Material:
    """A leaf surface.

    hue, chroma: Oklab. veins: contrast of the pale veins, in [0, 1]. luminance: mean reflectance. alpha: GGX
    roughness of the wax.
    """
    check_luminance("foliage", luminance)
    parameters = dict(locals())
    rng = np.random.default_rng(seed)
    shape = (_PIXELS, _PIXELS)
    blotch = band_noise(rng, shape, (5, 5), slope=0.8)
    net = 1 - smoothstep(0.0, 0.25, np.abs(band_noise(rng, shape, (9, 9))))
    value = 0.4 + 0.12 * blotch + 0.5 * veins * net
    stops = lch([0.05, 0.16, 0.4], [chroma, chroma, 0.8 * chroma], [hue + 0.1, hue, hue - 0.25])
    pixels = colorize(levels(value, _STEPS), ramp(stops, _STEPS), luminance)
    return dielectric("foliage", parameters, pixels, size=_SIZE, alpha=alpha, ior=1.45)


def sample_foliage(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """Yellowish to bluish greens."""
    drawn = {
        "hue": draw(rng, 2.05, 2.55),
        "chroma": draw(rng, 0.06, 0.12),
        "veins": draw(rng, 0.1, 0.6),
        "luminance": role.draw_luminance(rng),
        "alpha": role.draw_alpha(rng),
        "seed": draw_seed(rng),
    }
    return build_with(foliage, drawn, fixed)
