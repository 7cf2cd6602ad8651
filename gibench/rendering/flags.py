"""Masks of Mitsuba's flags. They are the same under every variant, but Mitsuba names them only once one is set.

So they are looked up when they are first used, and modules that use them can be imported before a variant is set.
Write `flags.DIFFUSE`: `from … import DIFFUSE` would look it up at once.
"""

from __future__ import annotations

DIFFUSE: int
"""Lobe of the diffuse reflection."""

NOT_DIFFUSE: int
"""All lobes that count as specular."""

ALL_LOBES: int

TRANSMITS: int
"""Lobes that let light through, sharp ones and glossy ones."""

SHARP: int
"""Lobes that reflect or let through in a single direction."""

HIT_WITH_CURVATURE: int
"""Ray flags for surface interactions with derivatives of the normal."""


def _masks() -> dict[str, int]:
    import mitsuba as mi

    lobes = mi.BSDFFlags
    return {
        "DIFFUSE": int(lobes.DiffuseReflection),
        "NOT_DIFFUSE": int(lobes.All) & ~int(lobes.DiffuseReflection),
        "ALL_LOBES": int(lobes.All),
        "TRANSMITS": int(lobes.DeltaTransmission | lobes.GlossyTransmission | lobes.Null),
        "SHARP": int(lobes.DeltaReflection | lobes.DeltaTransmission | lobes.Null),
        "HIT_WITH_CURVATURE": int(mi.RayFlags.All | mi.RayFlags.dNSdUV),
    }


def __getattr__(name: str) -> int:
    masks = {} if name.startswith("_") else _masks()
    if name not in masks:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals().update(masks)
    return masks[name]
