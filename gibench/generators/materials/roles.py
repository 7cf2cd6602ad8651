"""Bounds that a slot sets for the material that fills it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

GLOSSY_ALPHA = 0.1  # at or below this GGX alpha, a surface shows recognizable reflections


@dataclass(frozen=True)
class Role:
    """The bounds within which a family samples a material for one slot.

    slot: its name. luminance: range of the mean diffuse reflectance (linear luminance). alpha: range of GGX
    roughness; (0, 0) asks for a diffuse surface. Families that can only be matt ignore alpha, and metals
    ignore luminance.
    """

    slot: str
    luminance: tuple[float, float]
    alpha: tuple[float, float]

    def draw_luminance(self, rng: np.random.Generator) -> float:
        """A mean reflectance, uniform in the range."""
        return round(float(rng.uniform(*self.luminance)), 4)

    def draw_alpha(self, rng: np.random.Generator) -> float:
        """A roughness, log-uniform in the range; 0 for a diffuse role."""
        low, high = self.alpha
        spread = rng.random()
        return round(float(low * (high / low) ** spread), 4) if low > 0 else 0.0


def draw_seed(rng: np.random.Generator) -> int:
    """The seed of a texture's own noise, a parameter like any other."""
    return int(rng.integers(2**31))


def draw(rng: np.random.Generator, low: float, high: float) -> float:
    """Uniform in [low, high), rounded to what a JSON file should show."""
    return round(float(rng.uniform(low, high)), 4)


# What homes are furnished in: earth colours first, then blues and greens; (share, mean hue, spread).
_HUES = ((0.47, 1.1, 0.35), (0.27, 4.4, 0.3), (0.18, 2.4, 0.35), (0.08, 0.0, 2.0))


def draw_hue(rng: np.random.Generator) -> float:
    """An Oklab hue, radians in [0, 2π): mostly earth colours, blues and greens, seldom pinks and purples."""
    _, mean, spread = _HUES[int(rng.choice(len(_HUES), p=[share for share, _, _ in _HUES]))]
    return round(float(rng.normal(mean, spread)) % 6.2831, 4)
