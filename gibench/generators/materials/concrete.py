"""Concrete: blotches, pores and fine grit; raw on walls, sealed or polished on floors."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.materials.color import colorize, lch, levels, ramp
from gibench.generators.materials.noise import band_noise, smoothstep
from gibench.generators.materials.roles import Role, draw, draw_seed
from gibench.generators.materials.surface import build_with, check_luminance, dielectric
from gibench.generators.parts import Material

_PIXELS = 320
_SIZE = (2.0, 2.0)
_STEPS = 128


def concrete(
    *, blotches: float, pores: float, warmth: float, luminance: float, alpha: float, seed: int
) -> Material:
    """A concrete surface.

    blotches: relative contrast of the clouds in it. pores: in [0, 1], how many blow-holes it has. warmth:
    Oklab chroma towards yellow. luminance: mean reflectance. alpha: GGX roughness of the seal, 0 for raw
    concrete.
    """
    check_luminance("concrete", luminance)
    parameters = dict(locals())
    rng = np.random.default_rng(seed)
    shape = (_PIXELS, _PIXELS)
    cloud = band_noise(rng, shape, (2.5, 2.5), slope=0.7)
    grit = band_noise(rng, shape, (90, 90))
    holes = smoothstep(2.9 - pores, 3.2 - pores, band_noise(rng, shape, (60, 60)))
    value = 0.6 + blotches * (0.12 * cloud + 0.06 * grit) - 0.35 * holes
    stops = lch([0.15, 0.35, 0.55], [warmth, warmth, 0.8 * warmth], 1.5)
    pixels = colorize(levels(value, _STEPS), ramp(stops, _STEPS), luminance)
    return dielectric("concrete", parameters, pixels, size=_SIZE, alpha=alpha)


def sample_concrete(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """From smooth and even to blotchy and full of pores."""
    drawn = {
        "blotches": draw(rng, 0.3, 0.9),
        "pores": draw(rng, 0.0, 0.8),
        "warmth": draw(rng, 0.0, 0.02),
        "luminance": role.draw_luminance(rng),
        "alpha": role.draw_alpha(rng),
        "seed": draw_seed(rng),
    }
    return build_with(concrete, drawn, fixed)
