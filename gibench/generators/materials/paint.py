"""One even colour: wall paint, lacquer, enamel, glaze, plastic; all that differs by colour and gloss alone."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.materials.color import lch
from gibench.generators.materials.roles import Role, draw, draw_hue
from gibench.generators.materials.surface import build_with, check_luminance, dielectric
from gibench.generators.parts import Material

# Chroma of a white or a grey, of a pastel and of an accent colour, and how often each is chosen.
_CHROMA = ((0.0, 0.008), (0.008, 0.03), (0.04, 0.12))
_MIX = {
    "wall": (0.5, 0.42, 0.08),
    "ceiling": (0.85, 0.15, 0.0),
    "skirting": (0.75, 0.2, 0.05),
    "door": (0.6, 0.3, 0.1),
    "window_frame": (0.85, 0.1, 0.05),
    "sill": (0.85, 0.15, 0.0),
    "ceramic": (0.5, 0.2, 0.3),
    "enamel": (0.95, 0.05, 0.0),
    "screen": (1.0, 0.0, 0.0),
    "plastic": (0.45, 0.2, 0.35),
    "pot": (0.4, 0.2, 0.4),
    "glassware": (0.3, 0.3, 0.4),
    "paper": (0.35, 0.2, 0.45),
}
_DEFAULT_MIX = (0.4, 0.35, 0.25)


def paint(*, luminance: float, chroma: float, hue: float, alpha: float) -> Material:
    """An even colour.

    luminance: mean reflectance in [0.02, 0.9]. chroma, hue: Oklab, see `color.lch`. alpha: GGX roughness, 0
    matt.
    """
    check_luminance("paint", luminance)
    parameters = dict(locals())
    return dielectric("paint", parameters, lch(luminance, chroma, hue), alpha=alpha)


def sample_paint(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """A white, a pastel or an accent, as often as the role has them."""
    mix = _MIX.get(role.slot, _DEFAULT_MIX)
    low, high = _CHROMA[int(rng.choice(3, p=mix))]
    drawn = {
        "luminance": role.draw_luminance(rng),
        "chroma": draw(rng, low, high),
        "hue": draw_hue(rng),
        "alpha": role.draw_alpha(rng),
    }
    return build_with(paint, drawn, fixed)
