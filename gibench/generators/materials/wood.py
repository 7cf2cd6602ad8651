"""A board of solid or veneered wood, as furniture and doors are made of. The grain runs along u."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.materials import grain
from gibench.generators.materials.color import colorize, levels
from gibench.generators.materials.roles import Role, draw, draw_seed
from gibench.generators.materials.surface import build_with, check_luminance, dielectric
from gibench.generators.parts import Material

_SHAPE = (320, 256)  # rows across the grain are finer than columns along it
_SIZE = (1.6, 0.64)


def wood(*, species: str, luminance: float, rings: int, figure: float, alpha: float, seed: int) -> Material:
    """A wooden surface.

    species: a key of `grain.SPECIES`. luminance: mean reflectance. rings: growth rings per 0.64 m across.
    figure: how far they wander, in rings. alpha: GGX roughness of the varnish, 0 for raw wood.
    """
    check_luminance("wood", luminance)
    parameters = dict(locals())
    value = grain.board(np.random.default_rng(seed), _SHAPE, species=species, rings=rings, figure=figure)
    pixels = colorize(levels(value, grain.STEPS), grain.palette(species), luminance)
    return dielectric("wood", parameters, pixels, size=_SIZE, alpha=alpha)


def sample_wood(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """A board of any species; dark ones where the role's reflectance allows it."""
    luminance = role.draw_luminance(rng)
    drawn = {
        "species": grain.draw_species(rng, luminance),
        "luminance": luminance,
        "rings": int(rng.integers(18, 48)),
        "figure": draw(rng, 0.6, 3.0),
        "alpha": role.draw_alpha(rng),
        "seed": draw_seed(rng),
    }
    return build_with(wood, drawn, fixed)
