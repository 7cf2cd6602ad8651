"""Fitted carpet: loops or cut pile with a mottle of several yarns."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.materials.color import colorize, lch, levels, ramp
from gibench.generators.materials.noise import band_noise
from gibench.generators.materials.roles import Role, draw, draw_hue, draw_seed
from gibench.generators.materials.surface import build_with, check_luminance, dielectric
from gibench.generators.parts import Material

_PIXELS = 256
_SIZE = (0.8, 0.8)
_STEPS = 128


def carpet(
    *, pile: float, mottle: float, ribs: int, chroma: float, hue: float, luminance: float, seed: int
) -> Material:
    """A fitted carpet, diffuse.

    pile: contrast of the single tufts. mottle: contrast of the shading where feet brushed the pile. ribs:
    rows of loops along u per 0.8 m, 0 for a cut pile. chroma, hue: Oklab. luminance: mean reflectance.
    """
    check_luminance("carpet", luminance)
    parameters = dict(locals())
    rng = np.random.default_rng(seed)
    shape = (_PIXELS, _PIXELS)
    tufts = band_noise(rng, shape, (75, 75))
    shading = band_noise(rng, shape, (3, 3), slope=0.8)
    value = 0.5 + 0.16 * pile * tufts + 0.12 * mottle * shading
    if ribs:
        v = ((np.arange(_PIXELS) + 0.5) * (ribs / _PIXELS))[:, None]
        value = value - 0.22 * pile * np.cos(2 * np.pi * v)
    stops = lch([0.12, 0.3, 0.5], [1.1 * chroma, chroma, 0.9 * chroma], hue)
    pixels = colorize(levels(value, _STEPS), ramp(stops, _STEPS), luminance)
    return dielectric("carpet", parameters, pixels, size=_SIZE, alpha=0.0)


def sample_carpet(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """Greys and beiges, now and then a colour."""
    drawn = {
        "pile": draw(rng, 0.3, 1.0),
        "mottle": draw(rng, 0.1, 0.5),
        "ribs": int(rng.integers(40, 70)) if rng.random() < 0.4 else 0,
        "chroma": draw(rng, 0.0, 0.03) if rng.random() < 0.7 else draw(rng, 0.03, 0.09),
        "hue": draw(rng, 1.0, 1.6) if rng.random() < 0.5 else draw_hue(rng),
        "luminance": role.draw_luminance(rng),
        "seed": draw_seed(rng),
    }
    return build_with(carpet, drawn, fixed)
