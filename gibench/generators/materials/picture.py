"""Framed art: landscapes, colour fields and geometric compositions. One picture, not a repeating tile."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.generators.materials.color import colorize, lch, levels
from gibench.generators.materials.errors import BadMaterial
from gibench.generators.materials.noise import band_noise
from gibench.generators.materials.roles import Role, draw, draw_hue, draw_seed
from gibench.generators.materials.surface import build_with, check_luminance, dielectric
from gibench.generators.parts import Material

_PIXELS = 160
_INKS = 8
_STEPS = 24


def picture(
    *, motif: str, size: list[float], chroma: float, hue: float, luminance: float, alpha: float, seed: int
) -> Material:
    """A picture that is upright where v grows upwards, because row 0 of a texture lies at v = 0.

    motif: "landscape", "fields" or "shapes". size: width and height that the picture fills, m. chroma, hue:
    Oklab, the strongest colour and the leading hue. luminance: mean reflectance. alpha: GGX roughness, 0
    without glass. Raises BadMaterial.
    """
    check_luminance("picture", luminance)
    if motif not in _MOTIFS or len(size) != 2 or min(size) <= 0:
        raise BadMaterial(
            f"picture: motif {motif!r}, size {size}; use {', '.join(_MOTIFS)} and two positive lengths"
        )
    parameters = dict(locals())
    rng = np.random.default_rng(seed)
    shape = (_PIXELS, _PIXELS)
    at = (np.arange(_PIXELS) + 0.5) / _PIXELS
    u, v = np.meshgrid(at, at)
    ink = _MOTIFS[motif](rng, u, v, size[0] / size[1])
    brush = 0.5 + 0.16 * band_noise(rng, shape, (30, 50))
    shade = np.linspace(0.08, 0.75, _INKS)
    if motif != "landscape":
        shade = rng.permutation(shade)
    inks = lch(
        shade,
        chroma * rng.uniform(0.3, 1, _INKS),
        hue + rng.normal(0, 0.6, _INKS) + 3.1 * (rng.random(_INKS) < 0.25),
    )
    tones = np.linspace(0.75, 1.25, _STEPS)
    palette = (inks[:, None] * tones[None, :, None]).reshape(-1, 3)
    index = ink * _STEPS + levels(brush, _STEPS)
    return dielectric(
        "picture", parameters, colorize(index, palette, luminance), size=(size[0], size[1]), alpha=alpha
    )


_Array = NDArray[np.float64]


def _landscape(rng: np.random.Generator, u: _Array, v: _Array, aspect: float) -> NDArray[np.int64]:
    """Ridges behind ridges under a sky, darker the nearer, with a sun or moon."""
    ink = np.full(u.shape, _INKS - 2, np.int64)
    centre, radius = rng.uniform(0.2, 0.8), rng.uniform(0.04, 0.1)
    disk = np.hypot((u - centre) * aspect, v - rng.uniform(0.65, 0.85)) < radius
    ink[disk] = _INKS - 1
    for layer in range(_INKS - 3, -1, -1):
        base = 0.08 + 0.62 * (layer + 0.5) / (_INKS - 2)
        phase = rng.uniform(0, 2 * np.pi, 4)
        ridge = base + sum(
            0.09 / k * np.sin(2 * np.pi * k * u[0] * rng.uniform(0.6, 1.2) + p)
            for k, p in enumerate(phase, start=1)
        )
        ink[v < ridge[None, :]] = layer
    return ink


def _fields(rng: np.random.Generator, u: _Array, v: _Array, aspect: float) -> NDArray[np.int64]:
    """Two to four soft-edged fields of colour on a ground."""
    ink = np.full(u.shape, rng.integers(_INKS), np.int64)
    count = int(rng.integers(2, 5))
    edges = np.sort(rng.uniform(0.1, 0.9, count - 1)).tolist()
    wobble = 0.006 * band_noise(rng, (u.shape[0], u.shape[1]), (5, 5), slope=1.5)
    for low, high in zip([0.06, *edges], [*edges, 0.94], strict=True):
        field = (np.abs(u - 0.5) < 0.43 + wobble) & (v > low + 0.015 + wobble) & (v < high - 0.015 + wobble)
        ink[field] = rng.integers(_INKS)
    return ink


def _shapes(rng: np.random.Generator, u: _Array, v: _Array, aspect: float) -> NDArray[np.int64]:
    """Circles, bars and half-planes laid over one another."""
    ink = np.full(u.shape, rng.integers(_INKS), np.int64)
    for _ in range(int(rng.integers(6, 14))):
        x, y = rng.uniform(0.1, 0.9, 2)
        turn, kind = rng.uniform(0, np.pi), rng.integers(3)
        du, dv = (u - x) * aspect, v - y
        along, across = du * np.cos(turn) + dv * np.sin(turn), dv * np.cos(turn) - du * np.sin(turn)
        if kind == 0:
            inside = np.hypot(du, dv) < rng.uniform(0.06, 0.22)
        elif kind == 1:
            inside = (np.abs(along) < rng.uniform(0.15, 0.4)) & (np.abs(across) < rng.uniform(0.01, 0.07))
        else:
            inside = (np.hypot(du, dv) < rng.uniform(0.1, 0.28)) & (across > 0)
        ink[inside] = rng.integers(_INKS)
    return ink


_MOTIFS = {"landscape": _landscape, "fields": _fields, "shapes": _shapes}


def sample_picture(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """Any motif; `size` is among the fixed parameters where the frame is known."""
    drawn = {
        "motif": str(rng.choice(list(_MOTIFS))),
        "size": [0.8, 0.6],
        "chroma": draw(rng, 0.03, 0.13),
        "hue": draw_hue(rng),
        "luminance": role.draw_luminance(rng),
        "alpha": role.draw_alpha(rng),
        "seed": draw_seed(rng),
    }
    return build_with(picture, drawn, fixed)
