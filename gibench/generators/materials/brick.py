"""Brick walls in running bond, bare or painted over."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.materials.color import colorize, lch, levels, ramp
from gibench.generators.materials.noise import band_noise, smoothstep
from gibench.generators.materials.roles import Role, draw, draw_seed
from gibench.generators.materials.surface import build_with, check_luminance, dielectric
from gibench.generators.parts import Material

_SHAPE = (320, 320)
_COLUMNS, _ROWS = 6, 16
_MODULE = (0.22, 0.075)  # brick of 21 × 6.5 cm and a joint of 1 cm
_JOINT = 0.01
_STEPS = 96


def brick(
    *, chroma: float, hue: float, variation: float, mortar: float, painted: bool, luminance: float, seed: int
) -> Material:
    """A brick wall, diffuse. Courses run along u.

    chroma, hue: of the bricks, Oklab. variation: relative spread of tone between bricks. mortar: its
    luminance relative to that of the bricks. painted: one coat of paint over bricks and joints, which leaves
    only shade in them. luminance: mean reflectance.
    """
    check_luminance("brick", luminance)
    parameters = dict(locals())
    rng = np.random.default_rng(seed)
    v = ((np.arange(_SHAPE[0]) + 0.5) * (_ROWS / _SHAPE[0]))[:, None]
    row = np.floor(v).astype(np.int32)
    u = (np.arange(_SHAPE[1]) + 0.5)[None, :] * (_COLUMNS / _SHAPE[1]) + 0.5 * (row % 2)
    column = np.floor(u).astype(np.int32)
    edge = np.minimum(
        np.minimum(u - column, 1 - (u - column)) * _MODULE[0], np.minimum(v - row, 1 - (v - row)) * _MODULE[1]
    )
    # Hand-struck bricks have no straight edges.
    edge = edge + 0.0012 * band_noise(rng, _SHAPE, (30, 30))
    joint = 1 - smoothstep(_JOINT / 2 - 0.0025, _JOINT / 2 + 0.0025, edge)
    tone = rng.normal(0, variation, (_ROWS, _COLUMNS)).astype(np.float32)
    grain = band_noise(rng, _SHAPE, (60, 60)) + band_noise(rng, _SHAPE, (14, 14))
    value = 0.5 + tone[row, column % _COLUMNS] + 0.06 * grain * (0.3 if painted else 1.0)
    clay = lch([0.12, 0.24, 0.38], [chroma, chroma, 0.9 * chroma], [hue - 0.12, hue, hue + 0.12])
    if painted:
        clay = lch([0.5 * (1 - variation), 0.5, 0.5 * (1 + 0.4 * variation)], chroma, hue)
    bricks = ramp(clay, _STEPS)
    filled = lch([0.5 * 0.72], chroma, hue) if painted else lch([0.24 * mortar], 0.2 * chroma, 1.4)
    palette = np.concatenate([bricks + (filled - bricks) * share for share in np.linspace(0, 1, 6)])
    pixels = colorize(levels(joint, 6) * _STEPS + levels(value, _STEPS), palette, luminance)
    return dielectric(
        "brick", parameters, pixels, size=(_COLUMNS * _MODULE[0], _ROWS * _MODULE[1]), alpha=0.0
    )


def sample_brick(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """Red, ochre or brown; a light wall is a painted one, because no bare brick is that light."""
    luminance = role.draw_luminance(rng)
    painted = luminance > 0.4
    drawn = {
        "chroma": draw(rng, 0.0, 0.02) if painted else draw(rng, 0.04, 0.08),
        "hue": draw(rng, 0.7, 1.15),
        "variation": draw(rng, 0.05, 0.2),
        "mortar": draw(rng, 0.7, 2.0),
        "painted": painted,
        "luminance": luminance,
        "seed": draw_seed(rng),
    }
    return build_with(brick, drawn, fixed)
