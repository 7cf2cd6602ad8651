"""Patterned rugs: stripes, diamonds, chevrons and checks in a few dyed wools."""

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

_PIXELS = 288
_STEPS = 24
_KNOT = 3  # texels to a knot: the pattern is stepped, as weaving makes it
_PATTERNS = ("stripes", "diamonds", "chevrons", "checks")


def rug(
    *, pattern: str, repeat: float, wools: int, chroma: float, hue: float, luminance: float, seed: int
) -> Material:
    """A patterned rug, diffuse.

    pattern: "stripes" (across u), "diamonds", "chevrons" or "checks". repeat: size of the motif, m; two
    motifs make a tile. wools: number of colours, 2 to 5. chroma, hue: Oklab, the strongest colour and the
    leading hue. luminance: mean reflectance. Raises BadMaterial for another pattern or number of wools.
    """
    check_luminance("rug", luminance)
    if pattern not in _PATTERNS or not 2 <= wools <= 5:
        raise BadMaterial(
            f"rug: pattern {pattern!r} of {wools} wools; use {', '.join(_PATTERNS)} and 2 to 5 wools"
        )
    parameters = dict(locals())
    rng = np.random.default_rng(seed)
    shape = (_PIXELS, _PIXELS)
    knot = np.arange(_PIXELS) // _KNOT * _KNOT / _PIXELS * 2  # motifs
    place = _place(pattern, knot[None, :], knot[:, None])
    # The motif is a series of bands, each of one wool, mirrored about its middle.
    bands = rng.permutation(np.arange(12) % wools)
    wool = np.broadcast_to(bands[np.minimum((place * 12).astype(np.int32), 11)], shape)
    value = 0.5 + 0.14 * band_noise(rng, shape, (80, 80)) + 0.07 * band_noise(rng, shape, (2, 30))
    shade = rng.permutation(np.linspace(0.25, 1.0, wools))
    colors = lch(
        0.5 * shade, chroma * rng.uniform(0.3, 1, wools), hue + rng.choice([0, 0.4, -0.5, 3.0], wools)
    )
    shades = np.linspace(0.6, 1.4, _STEPS)
    palette = (colors[:, None, :] * shades[None, :, None]).reshape(-1, 3)
    pixels = colorize(wool * _STEPS + levels(value, _STEPS), palette, luminance)
    return dielectric("rug", parameters, pixels, size=(2 * repeat, 2 * repeat), alpha=0.0)


def _place(pattern: str, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Position of a texel between the middle (0) and the border (1) of its motif, (H, W) or broadcastable."""
    x, y = np.abs(2 * (u % 1) - 1), np.abs(2 * (v % 1) - 1)
    if pattern == "stripes":
        return np.broadcast_to(x, np.broadcast_shapes(u.shape, v.shape))
    if pattern == "diamonds":
        return np.abs(x + y - 1)
    if pattern == "chevrons":
        return np.abs(2 * ((v + 0.5 * x) % 1) - 1)
    return np.maximum(x, y)


def sample_rug(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """Two to four wools, from greys to strong colours."""
    drawn = {
        "pattern": str(rng.choice(_PATTERNS)),
        "repeat": draw(rng, 0.2, 0.6),
        "wools": int(rng.integers(2, 5)),
        "chroma": draw(rng, 0.015, 0.1),
        "hue": draw_hue(rng),
        "luminance": role.draw_luminance(rng),
        "seed": draw_seed(rng),
    }
    return build_with(rug, drawn, fixed)
