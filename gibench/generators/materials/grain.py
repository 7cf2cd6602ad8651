"""Wood: its species, its palette and its grain, shared by boards, planks and parquet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gibench.generators.materials.color import lch, ramp
from gibench.generators.materials.noise import Map, band_noise, smoothstep


class Species(NamedTuple):
    """The figure of a wood.

    luminance: of a usual oiled board. chroma, hue: Oklab. late: luminance of the dark late wood relative to
    the early wood. pores: how strongly they show, in [0, 1].
    """

    luminance: float
    chroma: float
    hue: float
    late: float
    pores: float


# Chosen by eye to look like oiled boards.
SPECIES = {
    "oak": Species(0.32, 0.05, 1.28, 0.7, 0.6),
    "ash": Species(0.42, 0.035, 1.38, 0.72, 0.5),
    "beech": Species(0.36, 0.05, 1.2, 0.85, 0.2),
    "birch": Species(0.48, 0.04, 1.35, 0.87, 0.1),
    "pine": Species(0.43, 0.07, 1.3, 0.68, 0.05),
    "cherry": Species(0.24, 0.06, 1.04, 0.78, 0.15),
    "teak": Species(0.22, 0.06, 1.15, 0.65, 0.4),
    "walnut": Species(0.16, 0.04, 1.08, 0.55, 0.45),
}

STEPS = 128  # entries of a wood palette


def draw_species(rng: np.random.Generator, luminance: float) -> str:
    """A species that can have such a mean reflectance: the nearer its own, the likelier."""
    distance = np.array([abs(np.log(luminance / kind.luminance)) for kind in SPECIES.values()])
    share = np.exp(-5 * distance)
    return str(rng.choice(list(SPECIES), p=share / share.sum()))


def palette(species: str) -> NDArray[np.float64]:
    """(STEPS, 3) linear colours of a species from late to early wood; the luminances are relative."""
    _, chroma, hue, late, _ = SPECIES[species]
    stops = lch(
        [0.4 * late, 0.4 * (late + 1) / 2, 0.4], [chroma * 1.15, chroma, chroma * 0.9], [hue - 0.08, hue, hue]
    )
    return ramp(stops, STEPS)


def board(
    rng: np.random.Generator, shape: tuple[int, int], *, species: str, rings: int, figure: float
) -> Map:
    """The grain of one wide board that runs along u, periodic, (H, W) in [0, 1] from late to early wood.

    rings: growth rings across the tile, an integer so that the last meets the first. figure: how far the
    rings wander, in rings; large values give cathedral patterns.
    """
    height = shape[0]
    pores = SPECIES[species].pores
    across = np.linspace(0, rings, height, endpoint=False, dtype=np.float32)[:, None]
    wander = figure * band_noise(rng, shape, (1.2, 2.0), slope=1.6)
    phase = across + wander
    tooth = phase - np.floor(phase)
    # Early wood fades slowly into the dark late wood, which ends at a sharp edge.
    grain = 0.9 - 0.6 * smoothstep(0.1, 0.85, tooth) * (1 - smoothstep(0.85, 1.0, tooth))
    fibre = band_noise(rng, shape, (5, height / 4), width=0.8)
    pore = smoothstep(0.9, 1.9, band_noise(rng, shape, (12, height / 5), width=0.5))
    tone = band_noise(rng, shape, (1.2, 6))
    return np.clip(grain * (1 - 0.5 * pores * pore) + 0.1 * fibre + 0.08 * tone, 0, 1).astype(np.float32)
