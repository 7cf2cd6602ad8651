"""Parameters of a surface, read from its materials: diffuse albedo, specular albedo, roughness.

Evaluating the BSDF instead would be wrong off diffuse surfaces: pi times the value of a glossy lobe exceeds 1 by
orders of magnitude. Parameters reach through two sides, masks, blends, bump and normal maps (`layers`) and may be
textured. Whatever a surface lets through counts as specular, as it does in the radiance channels: clear glass has a
specular albedo of 1, and so have the holes of a mask.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.rendering import flags
from gibench.rendering.scene import Scene

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Of linear Rec. 709."""


FAINT = 1e-6
"""Specular albedo below which a surface has no specular lobe: weights of blends and masks leave the rounding of float32
where one of two materials is all there is."""


def _attribute(evaluate, bsdf, name, si, active, default):
    has = active & bsdf.has_attribute(name, active)
    # The scalar variant raises where a vectorised one returns zeros for lanes that are masked out.
    return default if has is False else dr.select(has, evaluate(name, si, has), default)


def _color(bsdf, name, si, active, default):
    return _attribute(bsdf.eval_attribute, bsdf, name, si, active, default)


def _scalar(bsdf, name, si, active, default):
    return _attribute(bsdf.eval_attribute_1, bsdf, name, si, active, default)


def _is_conductor(bsdf, active):
    return active & bsdf.has_attribute("k", active)


def albedo(scene: Scene, bsdf: Any, si: Any, active: Any) -> Any:
    """Diffuse reflectance, mi.Color3f in [0, 1]: 0 for conductors, dielectrics and misses."""
    parts, _ = scene.layers.parts(bsdf, si, active)
    total = mi.Color3f(0)
    for part in parts:
        total += part.weight * _leaf_albedo(scene, part.bsdf, si, active & (part.weight > 0))
    return total


def specular_albedo(scene: Scene, bsdf: Any, si: Any, active: Any) -> Any:
    """Reflectance of all but the diffuse lobe at normal incidence, mi.Color3f in [0, 1]: 0 for diffuse ones and misses.

    ((η−1)/(η+1))² for a coat, ((η−1)²+k²)/((η+1)²+k²) for a conductor (`material` "none" has η = 0, k = 1: all is
    reflected), each times the BSDF's `specular_reflectance`; for a dielectric that and what it lets through.
    """
    parts, holes = scene.layers.parts(bsdf, si, active)
    total = mi.Color3f(dr.select(active, holes, 0))
    for part in parts:
        total += part.weight * _leaf_specular(scene, part.bsdf, si, active & (part.weight > 0))
    return total


def roughness(scene: Scene, bsdf: Any, si: Any, active: Any) -> Any:
    """GGX alpha: 0 for a smooth surface, 1 where there is no specular lobe, 0 on a miss.

    √(αu αv) for an anisotropic lobe. Of several lobes the mean, each weighted by the luminance of its specular albedo.
    """
    parts, holes = scene.layers.parts(bsdf, si, active)
    if len(parts) == 1 and scene.layers.depth == 0:
        return _leaf_roughness(scene, parts[0].bsdf, si, active)
    total, rough = dr.select(active, holes, mi.Float(0)), mi.Float(0)
    for part in parts:
        on = active & (part.weight > 0)
        lobe = _leaf_specular(scene, part.bsdf, si, on)
        weight = part.weight * (LUMINANCE[0] * lobe.x + LUMINANCE[1] * lobe.y + LUMINANCE[2] * lobe.z)
        total += weight
        rough += weight * _leaf_roughness(scene, part.bsdf, si, on)
    some = total > FAINT
    return dr.select(active, dr.select(some, rough / dr.select(some, total, 1), mi.Float(1)), 0)


def _metallic(bsdf, si, active):
    return dr.clip(_scalar(bsdf, "metallic", si, active, mi.Float(0)), 0, 1)


def _through(bsdf, si, active):
    """Share of a principled material that light goes through."""
    return dr.clip(_scalar(bsdf, "spec_trans", si, active, mi.Float(0)), 0, 1)


def _leaf_albedo(scene, bsdf, si, active):
    plain = _color(
        bsdf, "reflectance", si, active, _color(bsdf, "diffuse_reflectance", si, active, mi.Color3f(0))
    )
    if not scene.layers.principled:
        return plain
    base = _color(bsdf, "base_color", si, active, mi.Color3f(0))
    matte = (1 - _metallic(bsdf, si, active)) * (1 - _through(bsdf, si, active))
    # Of a thin sheet 2 is all that diffuse light can be sent to the other side.
    matte *= 1 - 0.5 * dr.clip(_scalar(bsdf, "diff_trans", si, active, mi.Float(0)), 0, 2)
    return plain + matte * base


def _leaf_specular(scene, bsdf, si, active):
    tint = _color(bsdf, "specular_reflectance", si, active, mi.Color3f(1))
    metal = _is_conductor(bsdf, active)
    eta = dr.select(
        metal, _color(bsdf, "eta", si, metal, mi.Color3f(1)), scene.layers.eta(bsdf, si, active & ~metal)
    )
    k = _color(bsdf, "k", si, metal, mi.Color3f(0))
    base = (dr.square(eta - 1) + dr.square(k)) / (dr.square(eta + 1) + dr.square(k))
    plain = dr.select(active, tint * base, 0)
    if scene.layers.transmits:
        through = active & ((bsdf.flags() & flags.TRANSMITS) != 0)
        # A pane reflects at both of its faces, and what is between them back and forth.
        pane = through & ((bsdf.flags() & int(mi.BSDFFlags.Null)) != 0)
        base = dr.select(pane, 2 * base / (1 + base), base)
        let_through = _color(bsdf, "specular_transmittance", si, through, mi.Color3f(1))
        plain = dr.select(through, tint * base + let_through * (1 - base), plain)
    if not scene.layers.principled:
        return plain
    principled = active & bsdf.has_attribute("base_color", active)
    color = _color(bsdf, "base_color", si, active, mi.Color3f(0))
    # `specular` stands for an index of refraction: F0 = 0.08 · specular (Burley 2012).
    f0 = dr.select(
        bsdf.has_attribute("specular", active),
        0.08 * _scalar(bsdf, "specular", si, active, mi.Float(0)),
        base.x,
    )
    metallic = _metallic(bsdf, si, active)
    hue = _scalar(bsdf, "spec_tint", si, active, mi.Float(0))
    light = LUMINANCE[0] * color.x + LUMINANCE[1] * color.y + LUMINANCE[2] * color.z
    tinted = dr.select(light > 0, color / dr.select(light > 0, light, 1), 1)
    dielectric = f0 * dr.lerp(mi.Color3f(1), tinted, hue)
    through = _through(bsdf, si, active) * (1 - metallic)
    reflected = dr.lerp(dielectric, color, metallic)
    return dr.select(principled, reflected + through * dr.sqrt(color) * (1 - f0), plain)


def _leaf_roughness(scene, bsdf, si, active):
    plain = dr.select((bsdf.flags() & flags.SHARP) != 0, mi.Float(0), mi.Float(1))
    alpha = _scalar(bsdf, "alpha", si, active, plain)
    along_u = _scalar(bsdf, "alpha_u", si, active, alpha)
    along_v = _scalar(bsdf, "alpha_v", si, active, along_u)
    alpha = dr.select(along_u == along_v, along_u, dr.sqrt(along_u * along_v))
    if scene.layers.principled:
        principled = active & bsdf.has_attribute("base_color", active)
        alpha = dr.select(principled, dr.square(_scalar(bsdf, "roughness", si, active, mi.Float(0.5))), alpha)
    return dr.select(active, alpha, 0)
