"""A floor of wooden planks that run along u, with joints between them."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.materials import grain
from gibench.generators.materials.color import colorize, levels
from gibench.generators.materials.joints import joint_cover
from gibench.generators.materials.noise import lookup
from gibench.generators.materials.roles import Role, draw, draw_seed
from gibench.generators.materials.surface import build_with, check_luminance, dielectric
from gibench.generators.parts import Material

_SHAPE = (448, 320)
_BOARD = (256, 192)
_COLUMNS = 2  # planks end to end before the texture repeats


def planks(
    *,
    species: str,
    width: float,
    length: float,
    rows: int,
    gap: float,
    variation: float,
    luminance: float,
    alpha: float,
    seed: int,
) -> Material:
    """A plank floor.

    species: a key of `grain.SPECIES`. width, length: of a plank, m. rows: planks side by side before the
    texture repeats. gap: width of the dark joint, m. variation: relative spread of tone from plank to plank.
    luminance: mean reflectance. alpha: GGX roughness of the varnish.
    """
    check_luminance("planks", luminance)
    parameters = dict(locals())
    rng = np.random.default_rng(seed)
    size = (length * _COLUMNS, width * rows)
    height, breadth = _SHAPE
    v = ((np.arange(height, dtype=np.float32) + 0.5) * (rows / height))[:, None]
    row = np.floor(v).astype(np.int32)
    # Each row of planks is shifted along, by no regular step.
    u = (np.arange(breadth, dtype=np.float32) + 0.5)[None, :] * (_COLUMNS / breadth)
    u = u + rng.random(rows, dtype=np.float32)[row]
    column = np.floor(u).astype(np.int32)
    plank = row * _COLUMNS + column % _COLUMNS

    texel_u, texel_v = size[0] / breadth, size[1] / height
    joint = np.maximum(
        joint_cover(u - column, length, gap, texel_u), joint_cover(v - row, width, gap, texel_v)
    )
    # Every plank is sawn from its own place of one wide board, of which a texel is 1.6 mm wide and 7 mm long.
    source = grain.board(
        rng, _BOARD, species=species, rings=int(rng.integers(16, 40)), figure=float(rng.uniform(0.8, 2.5))
    )
    cut = rng.integers(0, _BOARD[0], (2, rows * _COLUMNS), dtype=np.int32)
    value = lookup(
        source,
        (v * (width / 0.0016)).astype(np.int32) + cut[0][plank],
        ((u - column) * (length / 0.007)).astype(np.int32) + cut[1][plank],
    )
    tone = 1 + variation * (rng.random(rows * _COLUMNS, dtype=np.float32) - 0.5)
    steps = grain.STEPS
    shades = np.linspace(1 - variation / 2, 1 + variation / 2, 8)
    shade_of = np.clip((tone - shades[0]) / max(variation, 1e-6) * 8, 0, 7).astype(np.int32)
    index = (shade_of[plank] * 6 + levels(joint, 6)) * steps + levels(value, steps)
    colors = grain.palette(species)
    palette = np.concatenate(
        [colors * shade * (1 - 0.85 * dark) for shade in shades for dark in np.linspace(0, 1, 6)]
    )
    return dielectric("planks", parameters, colorize(index, palette, luminance), size=size, alpha=alpha)


def sample_planks(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """Planks of 10 to 20 cm by 1 to 2 m."""
    luminance = role.draw_luminance(rng)
    drawn = {
        "species": grain.draw_species(rng, luminance),
        "width": draw(rng, 0.1, 0.2),
        "length": draw(rng, 1.0, 2.0),
        "rows": int(rng.integers(6, 10)),
        "gap": draw(rng, 0.0008, 0.003),
        "variation": draw(rng, 0.1, 0.45),
        "luminance": luminance,
        "alpha": role.draw_alpha(rng),
        "seed": draw_seed(rng),
    }
    return build_with(planks, drawn, fixed)
