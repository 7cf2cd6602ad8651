"""Metals: Mitsuba's measured conductors, tinted and roughened into chrome, steel, brass, copper …"""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.materials.color import LIGHTEST
from gibench.generators.materials.errors import BadMaterial
from gibench.generators.materials.roles import Role, draw
from gibench.generators.materials.surface import build_with, name_of
from gibench.generators.parts import Material

# Reflectance at normal incidence of Mitsuba's measured conductors in its RGB variants, linear Rec. 709.
NORMAL_REFLECTANCE: dict[str, tuple[float, float, float]] = {
    "none": (1.0, 1.0, 1.0),
    "Al": (0.9280, 0.9178, 0.9189),
    "Ag": (0.9748, 0.9575, 0.9063),
    "Au": (0.9667, 0.8020, 0.3241),
    "Cr": (0.6876, 0.6491, 0.6870),
    "Cu": (0.9520, 0.6198, 0.5106),
    "W": (0.5746, 0.4778, 0.4331),
}

# finish: (conductor, tint on top of it). Mitsuba has no data for alloys: brass is gold with less red and more
# blue, bronze a darkened copper, steel a slightly darkened chromium, black steel a blackened one.
FINISHES: dict[str, tuple[str, tuple[float, float, float]]] = {
    "chrome": ("Cr", (1.0, 1.0, 1.0)),
    "steel": ("Cr", (0.92, 0.95, 0.9)),
    "nickel": ("Cr", (0.98, 0.97, 0.84)),
    "aluminium": ("Al", (0.96, 0.96, 0.96)),
    "anodized": ("Al", (0.5, 0.51, 0.53)),
    "black steel": ("Cr", (0.22, 0.23, 0.22)),
    "brass": ("Au", (0.92, 0.93, 1.0)),
    "gold": ("Au", (0.93, 0.93, 0.93)),
    "copper": ("Cu", (0.94, 0.94, 0.94)),
    "bronze": ("Cu", (0.6, 0.6, 0.55)),
    "silver": ("Ag", (0.92, 0.92, 0.92)),
}

_FOR_SLOT = {
    "chrome": ("chrome", "chrome", "nickel", "silver"),
    "brass": ("brass", "brass", "gold", "copper", "bronze"),
}
_USUAL = ("steel", "aluminium", "anodized", "black steel", "nickel", "bronze")


def metal(*, finish: str, shade: float, alpha: float) -> Material:
    """A metal surface.

    finish: a key of `FINISHES`. shade: a factor in (0, 1] on the finish's reflectance (patina). alpha: GGX
    roughness in [0.001, 1]. The reflectance at normal incidence stays below 0.9 in every channel.
    """
    parameters = dict(locals())
    if finish not in FINISHES or not 0 < shade <= 1 or not 1e-3 <= alpha <= 1:
        raise BadMaterial(
            f"metal: finish {finish!r}, shade {shade}, alpha {alpha}; the finish is one of "
            f"{', '.join(FINISHES)}, the shade in (0, 1], alpha in [0.001, 1]"
        )
    conductor, tint = FINISHES[finish]
    factor = [min(t * shade, LIGHTEST / f) for t, f in zip(tint, NORMAL_REFLECTANCE[conductor], strict=True)]
    return Material(
        name_of("metal", parameters),
        "metal",
        "roughconductor",
        (factor[0], factor[1], factor[2]),
        alpha,
        conductor=conductor,
        parameters=parameters,
    )


def sample_metal(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """A finish that suits the slot: bright for chrome, warm for brass, any other metal elsewhere."""
    drawn = {
        "finish": str(rng.choice(_FOR_SLOT.get(role.slot, _USUAL))),
        "shade": draw(rng, 0.85, 1.0),
        "alpha": role.draw_alpha(rng),
    }
    return build_with(metal, drawn, fixed)
