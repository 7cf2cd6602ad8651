"""Parquet of small wooden blocks: herringbone or basket weave."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.generators.materials import grain
from gibench.generators.materials.color import colorize, levels
from gibench.generators.materials.errors import BadMaterial
from gibench.generators.materials.joints import joint_cover
from gibench.generators.materials.noise import lookup
from gibench.generators.materials.roles import Role, draw, draw_seed
from gibench.generators.materials.surface import build_with, check_luminance, dielectric
from gibench.generators.parts import Material

_PIXELS = 384
_BOARD = (256, 192)
_SHADES = 8
_GAP = 0.0015  # width of the dark joint between two blocks, m


def parquet(
    *,
    species: str,
    pattern: str,
    width: float,
    ratio: int,
    variation: float,
    luminance: float,
    alpha: float,
    seed: int,
) -> Material:
    """A parquet floor.

    species: a key of `grain.SPECIES`. pattern: "herringbone" or "basket". width: of a block, m; it is ratio
    times as long. variation: relative spread of tone from block to block. luminance: mean reflectance. alpha:
    GGX roughness of the varnish. Raises BadMaterial for another pattern.
    """
    check_luminance("parquet", luminance)
    if pattern not in _LAYOUTS:
        raise BadMaterial(f"parquet: pattern is {pattern!r}; use {' or '.join(_LAYOUTS)}")
    parameters = dict(locals())
    rng = np.random.default_rng(seed)
    cells = ratio * (4 if pattern == "basket" else 2)
    size = (cells * width, cells * width)
    at = (np.arange(_PIXELS, dtype=np.float32) + np.float32(0.5)) * np.float32(cells / _PIXELS)
    upright, block, along, across = _LAYOUTS[pattern](at[None, :], at[:, None], ratio)

    texel = cells / _PIXELS
    # In block widths, as everything here.
    joint = np.maximum(
        joint_cover(along / ratio, ratio, _GAP / width, texel), joint_cover(across, 1.0, _GAP / width, texel)
    )
    source = grain.board(
        rng, _BOARD, species=species, rings=int(rng.integers(12, 26)), figure=float(rng.uniform(0.6, 1.8))
    )
    count = int(block.max()) + 1
    cut = rng.integers(0, _BOARD[0], (2, count), dtype=np.int32)
    # 1.4 mm of wood to a texel of the board along its width, 3 mm along the grain.
    value = lookup(
        source,
        (across * (width / 0.0014)).astype(np.int32) + cut[0][block],
        (along * (width / 0.003)).astype(np.int32) + cut[1][block],
    )
    shades = np.linspace(1 - variation / 2, 1 + variation / 2, _SHADES)
    # Blocks laid across reflect a little differently from those laid along.
    shade = np.clip(
        rng.integers(0, _SHADES, count, dtype=np.int32)[block] + np.where(upright, -1, 0), 0, _SHADES - 1
    )
    index = (shade * 4 + levels(joint, 4)) * grain.STEPS + levels(value, grain.STEPS)
    colors = grain.palette(species)
    palette = np.concatenate([colors * s * (1 - dark) for s in shades for dark in (0, 0.25, 0.5, 0.7)])
    return dielectric("parquet", parameters, colorize(index, palette, luminance), size=size, alpha=alpha)


Layout = tuple[NDArray[np.bool_], NDArray[np.int32], NDArray[np.floating], NDArray[np.floating]]


def _herringbone(u: NDArray[np.floating], v: NDArray[np.floating], ratio: int) -> Layout:
    """Position of a texel in its block: upright, block number, position along and across, in block widths.

    In row j, a lying block covers the cells i with (i − j) mod 2·ratio < ratio; the others belong to blocks
    that stand in column i. The pattern repeats after 2·ratio cells both ways. u and v broadcast.
    """
    period = 2 * ratio
    i, j = np.floor(u).astype(np.int32), np.floor(v).astype(np.int32)
    step = (i - j) % period
    upright = step >= ratio
    block = np.where(upright, period + i % period, j % period)
    along = np.where(upright, period - 1 - step + (v - j), step + (u - i))
    across = np.where(upright, u - i, v - j)
    return upright, block, along, across


def _basket(u: NDArray[np.floating], v: NDArray[np.floating], ratio: int) -> Layout:
    """As `_herringbone`: squares of `ratio` blocks whose direction alternates, as on a chessboard."""
    square_u, square_v = np.floor(u / ratio).astype(np.int32), np.floor(v / ratio).astype(np.int32)
    upright = (square_u + square_v) % 2 == 1
    inner_u, inner_v = u - ratio * square_u, v - ratio * square_v
    along, over = np.where(upright, inner_v, inner_u), np.where(upright, inner_u, inner_v)
    lane = np.floor(over).astype(np.int32)
    return upright, (square_v * 4 + square_u) * ratio + lane, along, over - lane


_LAYOUTS = {"herringbone": _herringbone, "basket": _basket}


def sample_parquet(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """Blocks 5 to 9 cm wide."""
    pattern = str(rng.choice(["herringbone", "basket"], p=[0.7, 0.3]))
    luminance = role.draw_luminance(rng)
    drawn = {
        "species": grain.draw_species(rng, luminance),
        "pattern": pattern,
        "width": draw(rng, 0.06, 0.1) if pattern == "herringbone" else draw(rng, 0.04, 0.06),
        "ratio": int(rng.integers(4, 7)),
        "variation": draw(rng, 0.15, 0.5),
        "luminance": luminance,
        "alpha": role.draw_alpha(rng),
        "seed": draw_seed(rng),
    }
    return build_with(parquet, drawn, fixed)
