"""Woven cloth: plain weave, twill, stripes and plaids, for upholstery, curtains, bedding and lampshades."""

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

_THREADS = 64  # to a tile, both ways
_TEXELS = 4  # to a thread
_PIXELS = _THREADS * _TEXELS
_STEPS = 48

# Which yarn is on top at thread (i, j) of warp and weft, and the stripes that the yarns are dyed in.
_WEAVES = ("plain", "twill", "herringbone")
_DYES = ("plain", "melange", "stripe", "plaid")


def fabric(
    *,
    weave: str,
    dye: str,
    thread: float,
    relief: float,
    chroma: float,
    hue: float,
    second_shade: float,
    second_hue: float,
    luminance: float,
    seed: int,
) -> Material:
    """A woven cloth, diffuse.

    weave: "plain", "twill" or "herringbone". dye: "plain" (one yarn), "melange" (irregular yarn), "stripe"
    (along v) or "plaid". thread: spacing of the yarns, m; 64 of them make a tile. relief: contrast between a
    yarn's crown and its edges, in [0, 1]. chroma, hue: Oklab, of the first yarn; the second has second_shade
    times its luminance and another hue. luminance: mean reflectance. Raises BadMaterial for another weave or
    dye.
    """
    check_luminance("fabric", luminance)
    if weave not in _WEAVES or dye not in _DYES:
        raise BadMaterial(
            f"fabric: weave {weave!r}, dye {dye!r}; use one of {', '.join(_WEAVES)} and of {', '.join(_DYES)}"
        )
    parameters = dict(locals())
    rng = np.random.default_rng(seed)
    at = np.arange(_PIXELS)
    thread_of = at // _TEXELS
    # A yarn is round: bright at its crown, dark where it dives under the other.
    profile = np.sin(np.pi * ((at % _TEXELS) + 0.5) / _TEXELS).astype(np.float32)
    i, j = thread_of[None, :], thread_of[:, None]
    warp_up = _warp_on_top(weave, i, j)
    crown = np.where(warp_up, profile[None, :], profile[:, None])
    slub = band_noise(rng, (_PIXELS, _PIXELS), (40, 40))
    # The warp lies a little higher than the weft, and every yarn is a little thicker or thinner than the next.
    warp, weft = rng.normal([[0.0], [-0.06]], 0.05, (2, _THREADS)).astype(np.float32)
    value = 0.75 + relief * (0.3 * (crown - 0.64) + 0.05 * slub + np.where(warp_up, warp[i], weft[j]))

    second = np.where(warp_up, _dyed(rng, dye)[i], _dyed(rng, dye)[j] if dye != "stripe" else 0)
    shades = np.linspace(0.25, 1.25, _STEPS)
    first_yarn = lch(0.5 * shades, chroma, hue)
    second_yarn = lch(0.5 * second_shade * shades, chroma, second_hue)
    pixels = colorize(
        second.astype(np.int32) * _STEPS + levels(value - 0.25, _STEPS),
        np.concatenate([first_yarn, second_yarn]),
        luminance,
    )
    return dielectric("fabric", parameters, pixels, size=(thread * _THREADS, thread * _THREADS), alpha=0.0)


def _warp_on_top(weave: str, i: NDArray[np.integer], j: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Mask of the places where the warp (along v) covers the weft, for warp thread i and weft thread j."""
    if weave == "plain":
        return (i + j) % 2 == 0
    if weave == "twill":
        return (i + j) % 4 < 2
    fold = np.abs(i % 16 - 8)  # the diagonal turns back every eight threads
    return (fold + j) % 4 < 2


def _dyed(rng: np.random.Generator, dye: str) -> NDArray[np.bool_]:
    """Mask of the threads that are of the second yarn."""
    if dye == "plain":
        return np.zeros(_THREADS, np.bool_)
    if dye == "melange":
        return rng.random(_THREADS) < 0.4
    band = int(rng.choice([4, 8, 16]))  # divides the number of threads, so that the stripes close
    return (np.arange(_THREADS) // band) % 2 == 1


def sample_fabric(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """Coarse for upholstery, fine for bedding, curtains and lampshades; patterns are the exception."""
    coarse = role.slot == "fabric"
    dye = str(rng.choice(_DYES, p=[0.4, 0.4, 0.12, 0.08] if coarse else [0.62, 0.18, 0.15, 0.05]))
    if role.slot == "lampshade":
        dye = "plain"
    lively = rng.random() < {"fabric": 0.4, "curtain": 0.3, "linen": 0.2}.get(role.slot, 0.05)
    hue = draw_hue(rng)
    spread = draw(rng, -0.5, 0.5)
    drawn = {
        "weave": str(rng.choice(_WEAVES, p=[0.55, 0.3, 0.15])),
        "dye": dye,
        "thread": draw(rng, 0.002, 0.005) if coarse else draw(rng, 0.001, 0.0025),
        "relief": draw(rng, 0.4, 1.0) if coarse else draw(rng, 0.2, 0.6),
        "chroma": draw(rng, 0.03, 0.085) if lively else draw(rng, 0.0, 0.03),
        "hue": hue,
        "second_shade": draw(rng, 0.6, 0.9) if dye == "melange" else draw(rng, 0.35, 0.8),
        "second_hue": round((hue + spread) % 6.2832, 4),
        "luminance": role.draw_luminance(rng),
        "seed": draw_seed(rng),
    }
    return build_with(fabric, drawn, fixed)
