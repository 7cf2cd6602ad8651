"""What a BSDF is made of, read from its parameters: diffuse albedo, specular albedo, roughness.

Evaluating the BSDF instead would be wrong off diffuse surfaces: pi times the value of a glossy lobe exceeds 1 by
orders of magnitude. Parameters reach through `twosided` and may be textured.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import drjit as dr
import mitsuba as mi


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


def albedo(bsdf, si, active):
    """Diffuse reflectance, mi.Color3f in [0, 1]: 0 for conductors and misses."""
    return _color(
        bsdf, "reflectance", si, active, _color(bsdf, "diffuse_reflectance", si, active, mi.Color3f(0))
    )


def specular_albedo(bsdf, si, active):
    """Specular reflectance at normal incidence, mi.Color3f in [0, 1]: 0 for diffuse surfaces and misses.

    ((η−1)/(η+1))² for a coat, ((η−1)²+k²)/((η+1)²+k²) for a conductor (`material` "none" has η = 0, k = 1: all is
    reflected), each times the BSDF's `specular_reflectance`.
    """
    tint = _color(bsdf, "specular_reflectance", si, active, mi.Color3f(1))
    metal = _is_conductor(bsdf, active)
    eta = dr.select(
        metal, _color(bsdf, "eta", si, metal, mi.Color3f(1)), _scalar(bsdf, "eta", si, active, mi.Float(1))
    )
    k = _color(bsdf, "k", si, metal, mi.Color3f(0))
    base = (dr.square(eta - 1) + dr.square(k)) / (dr.square(eta + 1) + dr.square(k))
    return dr.select(active, tint * base, 0)


def roughness(bsdf, si, active):
    """GGX alpha: 0 for a smooth conductor, 1 where there is no specular lobe, 0 on a miss."""
    plain = dr.select(_is_conductor(bsdf, active), mi.Float(0), mi.Float(1))
    return dr.select(active, _scalar(bsdf, "alpha", si, active, plain), 0)
