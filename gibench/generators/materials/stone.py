"""Slabs of natural stone: veined marble, speckled granite, banded travertine."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.materials.color import colorize, lch, levels, ramp
from gibench.generators.materials.errors import BadMaterial
from gibench.generators.materials.noise import Map, band_noise, smoothstep, uniform
from gibench.generators.materials.roles import Role, draw, draw_hue, draw_seed
from gibench.generators.materials.surface import build_with, check_luminance, dielectric
from gibench.generators.parts import Material

_PIXELS = 320
_SIZE = (1.6, 1.6)
_STEPS = 256


def stone(
    *, kind: str, contrast: float, chroma: float, hue: float, luminance: float, alpha: float, seed: int
) -> Material:
    """A stone slab.

    kind: "marble", "granite" or "travertine". contrast: in [0, 1], between ground and veins or grains.
    chroma, hue: of the ground, Oklab. luminance: mean reflectance. alpha: GGX roughness of the polish.
    Raises BadMaterial for another kind.
    """
    check_luminance("stone", luminance)
    if kind not in _KINDS:
        raise BadMaterial(f"stone: kind is {kind!r}; use {', '.join(_KINDS)}")
    parameters = dict(locals())
    rng = np.random.default_rng(seed)
    value = _KINDS[kind](rng, (_PIXELS, _PIXELS))
    dark = 1 - 0.85 * contrast
    stops = lch([0.5 * dark, 0.5 * (0.35 * dark + 0.65), 0.5], [1.3 * chroma, chroma, 0.7 * chroma], hue)
    pixels = colorize(levels(value, _STEPS), ramp(stops, _STEPS), luminance)
    return dielectric("stone", parameters, pixels, size=_SIZE, alpha=alpha)


def _marble(rng: np.random.Generator, shape: tuple[int, int]) -> Map:
    """Veins are the zero lines of cloudy noise, thick where a second noise says so."""
    cloud = uniform(band_noise(rng, shape, (2.5, 2.5), slope=1.3))
    value = 1 - 0.25 * cloud
    for cycles, weight, sharp in ((1.6, 0.75, 16.0), (3.0, 0.4, 22.0)):
        line = np.abs(band_noise(rng, shape, (cycles, cycles), slope=1.5))
        thickness = 0.35 + uniform(band_noise(rng, shape, (2, 2)))
        value -= weight * np.exp(-sharp * line / thickness) * (0.3 + 0.7 * cloud)
    return value


def _granite(rng: np.random.Generator, shape: tuple[int, int]) -> Map:
    """Grains of a few millimetres in three tones."""
    coarse = uniform(band_noise(rng, shape, (70, 70)))
    fine = uniform(band_noise(rng, shape, (130, 130)))
    tone = 0.55 + 0.25 * smoothstep(0.45, 0.6, coarse) - 0.45 * smoothstep(0.72, 0.82, fine) + 0.12 * coarse
    return (tone + 0.05 * band_noise(rng, shape, (3, 3))).astype(np.float32)


def _travertine(rng: np.random.Generator, shape: tuple[int, int]) -> Map:
    """Wavy layers along u, with pores stretched along them."""
    layers = 14
    height = np.linspace(0, layers, shape[0], endpoint=False, dtype=np.float32)[:, None]
    wave = np.sin(2 * np.pi * (height + 0.6 * band_noise(rng, shape, (1.5, 3), slope=1.3)))
    pores = smoothstep(1.5, 2.6, band_noise(rng, shape, (22, 70)))
    streak = band_noise(rng, shape, (2, 26))
    return (0.68 + 0.06 * wave + 0.12 * streak - 0.45 * pores).astype(np.float32)


_KINDS = {"marble": _marble, "granite": _granite, "travertine": _travertine}


def sample_stone(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """Mostly marble; travertine and granite are calmer."""
    kind = str(rng.choice(list(_KINDS), p=[0.55, 0.25, 0.2]))
    warm = kind == "travertine" or rng.random() < 0.5
    drawn = {
        "kind": kind,
        "contrast": draw(rng, 0.35, 0.95),
        "chroma": draw(rng, 0.015, 0.035) if kind == "travertine" else draw(rng, 0.0, 0.025),
        "hue": draw(rng, 1.2, 1.55) if warm else draw_hue(rng),
        "luminance": role.draw_luminance(rng),
        "alpha": role.draw_alpha(rng),
        "seed": draw_seed(rng),
    }
    return build_with(stone, drawn, fixed)
