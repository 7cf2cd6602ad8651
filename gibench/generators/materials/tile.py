"""Ceramic tiles with grout: stacked or in running bond, plain, chequered or marbled."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.generators.materials.color import colorize, lch, levels, ramp
from gibench.generators.materials.errors import BadMaterial
from gibench.generators.materials.joints import joint_cover
from gibench.generators.materials.noise import Map, band_noise, lookup
from gibench.generators.materials.roles import Role, draw, draw_hue, draw_seed
from gibench.generators.materials.surface import build_with, check_luminance, dielectric
from gibench.generators.parts import Material

_STEPS = 64
_PIXELS = 384
_BONDS = ("stack", "running")
_PATTERNS = ("plain", "chequer", "marbled")


def tile(
    *,
    width: float,
    height: float,
    count: list[int],
    bond: str,
    pattern: str,
    grout: float,
    grout_shade: float,
    luminance: float,
    chroma: float,
    hue: float,
    variation: float,
    alpha: float,
    seed: int,
) -> Material:
    """A wall or floor of ceramic tiles.

    width, height: of one tile with its joint, m. count: tiles along u and v until the texture repeats, even
    numbers. bond: "stack" or "running" (each row shifted by half a tile). pattern: "plain", "chequer" or
    "marbled". grout: width of the joint, m; grout_shade: its luminance relative to the tile's. chroma, hue: of
    the glaze, Oklab. luminance: mean reflectance of the whole. variation: relative spread of tone between
    tiles. alpha: GGX roughness of the glaze.
    """
    check_luminance("tile", luminance)
    if (
        bond not in _BONDS
        or pattern not in _PATTERNS
        or len(count) != 2
        or any(n < 2 or n % 2 for n in count)
    ):
        raise BadMaterial(
            f"tile: bond {bond!r}, pattern {pattern!r}, count {count}; use one of {', '.join(_BONDS)}, one of "
            f"{', '.join(_PATTERNS)}, and two even numbers"
        )
    parameters = dict(locals())
    rng = np.random.default_rng(seed)
    columns, rows = count
    size = (width * columns, height * rows)
    shape = (_PIXELS, _PIXELS)
    u: NDArray[np.floating] = np.broadcast_to(
        (np.arange(_PIXELS, dtype=np.float32) + 0.5) * (columns / _PIXELS), shape
    )
    v = ((np.arange(_PIXELS, dtype=np.float32) + 0.5) * (rows / _PIXELS))[:, None]
    row = np.floor(v).astype(np.int32)
    if bond == "running":
        u = u + np.float32(0.5) * (row % 2)
    column = np.floor(u).astype(np.int32)
    inside_u, inside_v = u - column, v - row
    column = column % columns
    joint = np.maximum(
        joint_cover(inside_u, width, grout, size[0] / _PIXELS),
        joint_cover(inside_v, height, grout, size[1] / _PIXELS),
    )

    tone = 0.5 + variation * (rng.random((rows, columns), dtype=np.float32) - 0.5)
    value = tone[row, column] + _figure(rng, pattern, row, column, shape)
    clay = lch(0.4, chroma, hue)
    # A chequer is two glazes, one under half as bright as the other. Light tiles have less room above.
    dark = 0.35 if pattern == "chequer" else 0.55
    glaze = ramp([clay * dark, clay, clay * min(1.45, 0.89 / luminance)], _STEPS)
    mortar = np.full(3, 0.4 * grout_shade)
    palette = np.concatenate([glaze + (mortar - glaze) * share for share in np.linspace(0, 1, 5)])
    pixels = colorize(levels(joint, 5) * _STEPS + levels(value, _STEPS), palette, luminance)
    return dielectric("tile", parameters, pixels, size=size, alpha=alpha)


def _figure(
    rng: np.random.Generator,
    pattern: str,
    row: np.ndarray[Any, Any],
    column: np.ndarray[Any, Any],
    shape: tuple[int, int],
) -> Map:
    """Offset of the tone by the pattern, (H, W), before clipping to [0, 1]."""
    if pattern == "chequer":
        return np.where((row + column) % 2, 0.35, -0.45).astype(np.float32) + 0.02 * band_noise(
            rng, shape, (40, 40)
        )
    if pattern == "marbled":
        cloud = band_noise(rng, shape, (4, 4), slope=1.2)
        vein = np.exp(-np.abs(band_noise(rng, shape, (3, 3), slope=1.3)) * 14)
        slab = 0.08 * cloud - 0.3 * vein
        # Every tile is cut from another place of the slab.
        shift = rng.integers(0, shape[0], (2, row.max() + 1, column.max() + 1))
        rows, columns = np.indices(shape)
        cut = shift[:, row, column]
        return lookup(slab.astype(np.float32), rows + cut[0], columns + cut[1])
    return 0.015 * band_noise(rng, shape, (30, 30))


# (width, height, count) of usual tiles: from small wall tiles and metro tiles to floor slabs.
_WALL = (
    (0.1, 0.1, [8, 8]),
    (0.15, 0.15, [6, 6]),
    (0.2, 0.1, [4, 8]),
    (0.15, 0.075, [6, 12]),
    (0.3, 0.2, [4, 6]),
)
_FLOOR = (
    (0.2, 0.2, [6, 6]),
    (0.3, 0.3, [4, 4]),
    (0.33, 0.33, [4, 4]),
    (0.45, 0.45, [4, 4]),
    (0.6, 0.3, [2, 4]),
    (0.6, 0.6, [2, 2]),
)


def sample_tile(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """Large tiles for floors, small ones for walls."""
    formats = _FLOOR if role.slot == "floor" else _WALL
    width, height, count = formats[int(rng.integers(len(formats)))]
    on_floor = role.slot == "floor"
    pattern = str(rng.choice(_PATTERNS, p=[0.5, 0.15, 0.35] if on_floor else [0.85, 0.05, 0.1]))
    bond = "running" if width == 2 * height and rng.random() < 0.8 and pattern != "chequer" else "stack"
    drawn = {
        "width": width,
        "height": height,
        "count": count,
        "bond": bond,
        "pattern": pattern,
        "grout": draw(rng, 0.002, 0.005),
        "grout_shade": draw(rng, 0.45, 1.3),
        "luminance": role.draw_luminance(rng),
        "chroma": draw(rng, 0.0, 0.015) if rng.random() < 0.75 else draw(rng, 0.03, 0.07),
        "hue": draw_hue(rng),
        "variation": draw(rng, 0.05, 0.3),
        "alpha": role.draw_alpha(rng),
        "seed": draw_seed(rng),
    }
    return build_with(tile, drawn, fixed)
