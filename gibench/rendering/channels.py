"""The channel contract: every channel that a frame can hold, declared once.

The renderer, the files, the loaders and the methods refer to a channel by its name here. Adding one takes a
line in `CHANNELS` and its computation in `gbuffer` (surface-like sets) or `integrator` (radiance).
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass

from gibench.errors import GibenchError


class UnknownChannelError(GibenchError, KeyError):
    """A channel or set of channels that nobody has declared."""

    __str__ = Exception.__str__  # KeyError would print the message in quotation marks


@dataclass(frozen=True)
class Channel:
    """One named image of a frame.

    components: values a pixel. dtype: how it is stored: "half" (float16, or float32 where half would overflow or
    lose more than 1e-3), "float" (float32) or "uint" (uint32). unit: physical unit, "1" for ratios. set: the
    group by which it is asked for.
    """

    name: str
    components: int
    dtype: str
    unit: str
    meaning: str
    set: str


_RADIANCE = "W/(m^2 sr)"

_CUE = "direct light where every material that is not diffuse is"

PARTS = ("emission", "direct_diffuse", "direct_specular", "indirect_diffuse", "indirect_specular")
"""The five radiance channels whose sum is `color`, in the order in which they are added."""

CHANNELS: dict[str, Channel] = {
    c.name: c
    for c in (
        Channel("color", 3, "half", _RADIANCE, "the sum of the five parts", "radiance"),
        Channel(
            "emission", 3, "half", _RADIANCE, "depth 0: light seen straight at the first hit", "radiance"
        ),
        Channel("direct_diffuse", 3, "half", _RADIANCE, "depth 1, diffuse lobe at the first hit", "radiance"),
        Channel(
            "direct_specular", 3, "half", _RADIANCE, "depth 1, any other lobe at the first hit", "radiance"
        ),
        Channel("indirect_diffuse", 3, "half", _RADIANCE, "depth 2 and more, diffuse lobe first", "radiance"),
        Channel(
            "indirect_specular", 3, "half", _RADIANCE, "depth 2 and more, any other lobe first", "radiance"
        ),
        Channel("color_se", 3, "half", _RADIANCE, "standard error of color, from the samples", "radiance"),
        *(
            Channel(
                f"sampled_{part}", 3, "half", _RADIANCE, f"{part} as it was sampled, not denoised", "samples"
            )
            for part in PARTS[1:]
        ),
        Channel("position", 3, "float", "m", "first hit, world space", "surface"),
        Channel("normal", 3, "float", "1", "shading normal towards the viewer, world space", "surface"),
        Channel(
            "geometric_normal", 3, "float", "1", "face normal towards the viewer, world space", "surface"
        ),
        Channel("depth", 1, "float", "m", "distance along the optical axis", "surface"),
        Channel("distance", 1, "float", "m", "distance along the ray", "surface"),
        Channel("albedo", 3, "half", "1", "diffuse reflectance", "surface"),
        Channel("specular_albedo", 3, "half", "1", "specular reflectance at normal incidence", "surface"),
        Channel("roughness", 1, "half", "1", "GGX alpha; 1 where there is no specular lobe", "surface"),
        Channel("material_id", 1, "uint", "1", "material, from 1; 0 on a miss", "surface"),
        Channel("shape_id", 1, "uint", "1", "shape, from 1; 0 on a miss", "surface"),
        Channel("reflected_position", 3, "float", "m", "hit of the mirror ray, world space", "reflection"),
        Channel("reflected_normal", 3, "float", "1", "shading normal there", "reflection"),
        Channel("reflected_albedo", 3, "half", "1", "diffuse reflectance there", "reflection"),
        Channel("reflected_distance", 1, "float", "m", "length of the mirror ray", "reflection"),
        Channel("reflected_material_id", 1, "uint", "1", "material there, 0 on a miss", "reflection"),
        Channel("reflected_shape_id", 1, "uint", "1", "shape there, 0 on a miss", "reflection"),
        Channel(
            "curvature",
            2,
            "float",
            "1/m",
            "principal, larger size first, > 0 bends to the normal",
            "curvature",
        ),
        Channel("curvature_direction", 3, "float", "1", "direction of the first, world space", "curvature"),
        Channel("motion", 2, "float", "px", "from here to the same point in the frame before it", "motion"),
        Channel("motion_valid", 1, "half", "1", "1 where the point is seen in the frame before it", "motion"),
        Channel(
            "light_direction", 3, "float", "1", "towards the centre of the area light, 0 without", "lighting"
        ),
        Channel("radiance_cue_0", 3, "half", _RADIANCE, f"{_CUE} a white Lambertian one", "lighting"),
        Channel("radiance_cue_1", 3, "half", _RADIANCE, f"{_CUE} a white one of GGX alpha 0.05", "lighting"),
        Channel("radiance_cue_2", 3, "half", _RADIANCE, f"{_CUE} a white one of GGX alpha 0.13", "lighting"),
        Channel("radiance_cue_3", 3, "half", _RADIANCE, f"{_CUE} a white one of GGX alpha 0.34", "lighting"),
    )
}

SAMPLED = {f"sampled_{part}": part for part in PARTS[1:]}
"""Channels that keep the samples of a part beside its denoised image. Emission is not denoised, and needs none."""

CUES = ("radiance_cue_0", "radiance_cue_1", "radiance_cue_2", "radiance_cue_3")
"""Channels that are sampled like radiance, but for materials that stand in for the scene's (Gao et al. 2022)."""

SETS: dict[str, tuple[str, ...]] = {
    s: tuple(c.name for c in CHANNELS.values() if c.set == s)
    for s in dict.fromkeys(c.set for c in CHANNELS.values())
}


def resolve(names: Iterable[str]) -> tuple[str, ...]:
    """Channel names from a mixture of set and channel names, without repeats, in the order of the contract.

    Raises UnknownChannelError with the nearest names.

    >>> resolve(["motion", "color"])
    ('color', 'motion', 'motion_valid')
    """
    wanted: set[str] = set()
    for name in names:
        if name in SETS:
            wanted.update(SETS[name])
        elif name in CHANNELS:
            wanted.add(name)
        else:
            known = [*SETS, *CHANNELS]
            near = difflib.get_close_matches(name, known, n=3) or list(SETS)
            raise UnknownChannelError(f"unknown channel or set {name!r}: did you mean {', '.join(near)}?")
    return tuple(name for name in CHANNELS if name in wanted)
