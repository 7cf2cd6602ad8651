"""Rattan and wicker: flat strands that go over and under round stakes."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.materials.color import colorize, lch, levels, ramp
from gibench.generators.materials.noise import band_noise
from gibench.generators.materials.roles import Role, draw, draw_seed
from gibench.generators.materials.surface import build_with, check_luminance, dielectric
from gibench.generators.parts import Material

_PIXELS = 192
_STRANDS = 16
_STAKES = 8
_STEPS = 96


def wicker(*, strand: float, chroma: float, hue: float, luminance: float, seed: int) -> Material:
    """A woven wicker surface, diffuse.

    strand: width of a strand, m; strands run along u, stakes along v. chroma, hue: Oklab. luminance: mean
    reflectance.
    """
    check_luminance("wicker", luminance)
    parameters = dict(locals())
    rng = np.random.default_rng(seed)
    u = ((np.arange(_PIXELS) + 0.5) * (_STAKES / _PIXELS))[None, :]
    v = ((np.arange(_PIXELS) + 0.5) * (_STRANDS / _PIXELS))[:, None]
    row = np.floor(v).astype(np.int32)
    round_ = np.sqrt(np.maximum(0.0, 1 - (2 * (v - row) - 1) ** 2))
    # Every other strand passes over a stake where its neighbours pass under it.
    height = 0.5 + 0.5 * np.cos(np.pi * (u + row))
    tone = rng.normal(0, 0.07, _STRANDS)[row]
    fibre = band_noise(rng, (_PIXELS, _PIXELS), (8, 60))
    value = (0.15 + 0.45 * round_) * (0.45 + 0.55 * height) + 0.25 + tone + 0.05 * fibre
    stops = lch([0.06, 0.25, 0.5], [0.8 * chroma, 1.1 * chroma, chroma], [hue - 0.1, hue, hue + 0.05])
    pixels = colorize(levels(value, _STEPS), ramp(stops, _STEPS), luminance)
    size = (strand * 2 * _STAKES, strand * _STRANDS)
    return dielectric("wicker", parameters, pixels, size=size, alpha=0.0)


def sample_wicker(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """Strands of 4 to 9 mm, straw to brown."""
    drawn = {
        "strand": draw(rng, 0.004, 0.009),
        "chroma": draw(rng, 0.04, 0.08),
        "hue": draw(rng, 1.05, 1.45),
        "luminance": role.draw_luminance(rng),
        "seed": draw_seed(rng),
    }
    return build_with(wicker, drawn, fixed)
