"""Printed wallpaper: stripes, dots, trellis or leaves on a light ground."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.generators.materials.color import colorize, lch, levels
from gibench.generators.materials.errors import BadMaterial
from gibench.generators.materials.noise import band_noise, smoothstep
from gibench.generators.materials.roles import Role, draw, draw_hue, draw_seed
from gibench.generators.materials.surface import build_with, check_luminance, dielectric
from gibench.generators.parts import Material

_PIXELS = 256
_STEPS = 24


def wallpaper(
    *, pattern: str, repeat: float, ink: float, chroma: float, hue: float, luminance: float, seed: int
) -> Material:
    """A papered wall, diffuse.

    pattern: "stripes" (along v), "dots", "trellis" or "leaves". repeat: size of the motif, m; two by two
    motifs make a tile. ink: luminance of the print relative to the ground. chroma, hue: Oklab, of the print;
    the ground is paler. luminance: mean reflectance. Raises BadMaterial for another pattern.
    """
    check_luminance("wallpaper", luminance)
    if pattern not in _PATTERNS:
        raise BadMaterial(f"wallpaper: pattern is {pattern!r}; use {', '.join(_PATTERNS)}")
    parameters = dict(locals())
    rng = np.random.default_rng(seed)
    shape = (_PIXELS, _PIXELS)
    at = (np.arange(_PIXELS) + 0.5) * (2 / _PIXELS)
    print_ = np.broadcast_to(_PATTERNS[pattern](at[None, :], at[:, None]), shape)
    fibre = 0.5 + 0.07 * band_noise(rng, shape, (60, 60))
    ground = lch([0.5], 0.35 * chroma, hue)
    inked = lch([0.5 * ink], chroma, hue)
    shades = np.linspace(0.85, 1.15, _STEPS)
    palette = np.concatenate(
        [(ground + (inked - ground) * t) * s for t in np.linspace(0, 1, 6) for s in shades[:, None]]
    )
    pixels = colorize(levels(print_, 6) * _STEPS + levels(fibre, _STEPS), palette, luminance)
    return dielectric("wallpaper", parameters, pixels, size=(2 * repeat, 2 * repeat), alpha=0.0)


_Array = NDArray[np.floating]


def _stripes(u: _Array, v: _Array) -> _Array:
    wide = smoothstep(0.24, 0.26, np.abs(u % 1 - 0.5))
    pinstripe = 1 - smoothstep(0.015, 0.03, np.abs(u % 1 - 0.5))
    return np.maximum(wide, 0.7 * pinstripe) + 0 * v


def _dots(u: _Array, v: _Array) -> _Array:
    """Dots on the corners and in the middle of each motif."""
    radius = np.hypot(u % 1 - 0.5, v % 1 - 0.5)
    corner = np.hypot((u + 0.5) % 1 - 0.5, (v + 0.5) % 1 - 0.5)
    return 1 - smoothstep(0.1, 0.125, np.minimum(radius, corner))


def _trellis(u: _Array, v: _Array) -> _Array:
    """The zero lines of a wave: an ogee lattice."""
    wave = np.cos(2 * np.pi * u) + np.cos(2 * np.pi * v) + 0.35 * np.cos(4 * np.pi * v)
    return 1 - smoothstep(0.08, 0.22, np.abs(wave))


def _leaves(u: _Array, v: _Array) -> _Array:
    """Lens-shaped leaves that lean left and right by turns along wavy stems."""
    stem = 0.5 + 0.12 * np.sin(2 * np.pi * v)
    ink = 1 - smoothstep(0.012, 0.03, np.abs(u % 1 - stem))
    for side, level in ((1, 0.15), (-1, 0.4), (1, 0.65), (-1, 0.9)):
        centre = 0.5 + 0.12 * np.sin(2 * np.pi * level) + 0.2 * side
        du = (u - centre + 0.5) % 1 - 0.5
        dv = (v - level - 0.08 + 0.5) % 1 - 0.5
        along, across = 0.8 * side * du + 0.6 * dv, 0.6 * du - 0.8 * side * dv
        body = np.abs(across) - 0.08 * (1 - (along / 0.19) ** 2)
        ink = np.maximum(ink, 1 - smoothstep(-0.012, 0.012, body))
    return ink


_PATTERNS = {"stripes": _stripes, "dots": _dots, "trellis": _trellis, "leaves": _leaves}


def sample_wallpaper(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """Usually tone on tone."""
    bold = rng.random() < 0.3
    drawn = {
        "pattern": str(rng.choice(list(_PATTERNS))),
        "repeat": draw(rng, 0.12, 0.35),
        "ink": draw(rng, 0.4, 0.7) if bold else draw(rng, 0.75, 0.92),
        "chroma": draw(rng, 0.03, 0.07) if bold else draw(rng, 0.005, 0.035),
        "hue": draw_hue(rng),
        "luminance": role.draw_luminance(rng),
        "seed": draw_seed(rng),
    }
    return build_with(wallpaper, drawn, fixed)
