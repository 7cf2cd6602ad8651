"""Terrazzo: chips of stone in polished cement."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.materials.cells import cells
from gibench.generators.materials.color import colorize, lch
from gibench.generators.materials.roles import Role, draw, draw_hue, draw_seed
from gibench.generators.materials.surface import build_with, check_luminance, dielectric
from gibench.generators.parts import Material

_PIXELS = 256
_GRID = 28
_KINDS = 5


def terrazzo(
    *, chip: float, coverage: float, chroma: float, hue: float, luminance: float, alpha: float, seed: int
) -> Material:
    """A terrazzo surface.

    chip: spacing of the chips, m. coverage: in [0, 1], how much of its cell the largest chip fills. chroma,
    hue: Oklab, the strongest colour and the leading hue among the chips. luminance: mean reflectance. alpha:
    GGX roughness of the polish.
    """
    check_luminance("terrazzo", luminance)
    parameters = dict(locals())
    rng = np.random.default_rng(seed)
    found = cells(rng, (_PIXELS, _PIXELS), _GRID)
    count = _GRID * _GRID
    reach = coverage * rng.uniform(0.2, 0.75, count).astype(np.float32)
    inside = (found.nearest < reach[found.number]) & (found.second - found.nearest > 0.12)
    kind = 1 + rng.integers(0, _KINDS, count)
    index = np.where(inside, kind[found.number], 0)
    chips = lch(
        rng.uniform(0.12, 0.75, _KINDS),
        chroma * rng.uniform(0.2, 1, _KINDS),
        hue + rng.normal(0, 0.5, _KINDS),
    )
    palette = np.concatenate([lch([0.48], 0.15 * chroma, hue), chips])
    size = (chip * _GRID, chip * _GRID)
    return dielectric("terrazzo", parameters, colorize(index, palette, luminance), size=size, alpha=alpha)


def sample_terrazzo(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """Chips of 1.2 to 3 cm, from grey to colourful."""
    drawn = {
        "chip": draw(rng, 0.012, 0.03),
        "coverage": draw(rng, 0.6, 1.0),
        "chroma": draw(rng, 0.01, 0.08),
        "hue": draw_hue(rng),
        "luminance": role.draw_luminance(rng),
        "alpha": role.draw_alpha(rng),
        "seed": draw_seed(rng),
    }
    return build_with(terrazzo, drawn, fixed)
