"""One compiled kernel for many scenes.

Dr.Jit compiles a call of a BSDF, shape or emitter for every kind of plugin that is alive, and bakes into the kernel
how many there are. Two furnished rooms differ in both, so each would be compiled anew: a second or more a room. Here
spare plugins are kept alive beside a scene: one of every kind that rooms use, and as many more as it takes to bring
the counts to the next multiple. No ray ever meets them.
"""

from __future__ import annotations

from typing import Any

BSDF_STEP = 256
SHAPE_STEP = 256
EMITTER_STEP = 32
"""Counts are filled up to multiples of these; most rooms lie below the first."""


def spare_plugins() -> tuple[Any, ...]:
    """Plugins to be kept alive as long as a scene that has just been loaded. Nothing under the scalar variant."""
    import drjit as dr
    import mitsuba as mi

    from gibench.rendering.backend import is_scalar

    if is_scalar():
        return ()
    pixel = mi.Bitmap(dr.full(mi.TensorXf, 0.5, (1, 1, 3)))
    colors: list[dict[str, Any]] = [
        {"type": "rgb", "value": [0.5, 0.4, 0.3]},
        {"type": "bitmap", "bitmap": pixel},
    ]
    metal = {"material": "Cr", "specular_reflectance": colors[0]}
    kinds: list[dict[str, Any]] = [
        *({"type": "diffuse", "reflectance": color} for color in colors),
        *({"type": "roughplastic", "distribution": "ggx", "diffuse_reflectance": color} for color in colors),
        {"type": "roughconductor", "distribution": "ggx", **metal},
        {"type": "conductor", **metal},
    ]
    spare: list[Any] = [mi.load_dict({"type": "twosided", "inside": kind}) for kind in kinds]
    plain = spare[0]
    lamp = {"bsdf": plain, "emitter": {"type": "area", "radiance": colors[0]}}
    spare += [mi.load_dict({"type": name, **lamp}) for name in ("sphere", "disk", "rectangle", "cube")]
    panorama = mi.Bitmap(dr.full(mi.TensorXf, 0.5, (2, 4, 3)))
    spare.append(mi.load_dict({"type": "envmap", "bitmap": panorama}))
    fillers = (
        (mi.EmitterPtr, EMITTER_STEP, {"type": "sphere", **lamp}),  # first, since these are shapes too
        (mi.ShapePtr, SHAPE_STEP, {"type": "sphere", "bsdf": plain}),
        (mi.BSDFPtr, BSDF_STEP, kinds[0]),
    )
    for pointer, step, description in fillers:
        number = 1
        while number % step:
            spare.append(mi.load_dict(description))
            last = spare[-1].emitter() if pointer is mi.EmitterPtr else spare[-1]
            number = int(dr.reinterpret_array(mi.UInt32, pointer(last))[0])
    return tuple(spare)
