"""The lobes of a material: its diffuse reflection, and everything else, which counts as specular.

Mitsuba's materials evaluate the lobes that a `BSDFContext` asks for, but for `principled`, which evaluates all of them
whichever it is asked for; and they sample those lobes, but for this one and `pplastic`. Here both are taken apart,
inside of blends, masks and two-sided materials too, so that whoever wants one lobe gets that lobe whatever the material
is: the path tracer, lightmaps, probes, and methods that follow the specular lobe alone.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.rendering import flags
from gibench.rendering.layers import Layers
from gibench.rendering.light_sampling import inverse

EVEN_DIRECTIONS = 16
"""From which light comes where it comes from all sides alike."""

GOLDEN_ANGLE = 2.399963
"""Radians between one of these and the next, around the normal."""


def lobes_of(mask: int) -> Any:
    """A mi.BSDFContext that asks for the lobes of a mask."""
    return mi.BSDFContext(mi.TransportMode.Radiance, mask)


def diffuse_lobe(layers: Layers | None, bsdf: Any, si: Any, wo: Any, active: Any) -> Any:
    """The diffuse reflection of a material from wo towards si.wi, mi.Color3f, cosine included.

    layers: `Scene.layers`, without which all of `principled` counts as diffuse. bsdf: mi.BSDFPtr. wo: mi.Vector3f, in
    the frame of si.
    """
    value = bsdf.eval(lobes_of(flags.DIFFUSE), si, wo, active)
    if layers is None or not layers.principled:
        return value
    context = lobes_of(flags.DIFFUSE)
    front = mi.SurfaceInteraction3f(si)
    front.wi = mi.Vector3f(si.wi.x, si.wi.y, dr.abs(si.wi.z))
    wo = mi.Vector3f(wo.x, wo.y, dr.mulsign(wo.z, si.wi.z))
    excess = mi.Spectrum(0)
    for part in layers.parts(bsdf, si, active)[0]:
        on = active & (part.weight > 0)
        on &= part.bsdf.has_attribute("base_color", on)
        all_lobes = part.bsdf.eval(context, front, wo, on)
        excess += dr.select(on, part.weight * (all_lobes - _principled_diffuse(part.bsdf, front, wo, on)), 0)
    return dr.clip(value - excess, 0, value)


@dr.syntax
def diffuse_reflectance(layers: Layers | None, bsdf: Any, si: Any, active: Any) -> Any:
    """Share of even light that the diffuse reflection of a material sends towards si.wi, mi.Color3f in [0, 1].

    It is the albedo where the material is Lambert's. A coat reflects some of the light before it comes to what is
    beneath, and some of what comes back inside: at an alpha of 0.1 to 0.3 `roughplastic` keeps 87 to 55 %, the rougher
    it is and the more grazing the view, the less. Arguments as of `diffuse_lobe`. Needs a vectorised variant.
    """
    total, number = mi.Color3f(0), mi.UInt32(0)
    while number < EVEN_DIRECTIONS:
        square = (mi.Float(number) + 0.5) / EVEN_DIRECTIONS
        cosine, sine = dr.sqrt(square), dr.sqrt(1 - square)
        across, along = dr.sincos(GOLDEN_ANGLE * mi.Float(number))
        wo = mi.Vector3f(sine * along, sine * across, dr.copysign(cosine, si.wi.z))
        total += diffuse_lobe(layers, bsdf, si, wo, active) / cosine
        number += 1
    return dr.select(active, total * (dr.pi / EVEN_DIRECTIONS), 0)


def split(bsdf: Any, value: Any, diffuse: Any) -> tuple[Any, Any]:
    """A BSDF's value as the share of its diffuse reflection and that of everything else, both ≥ 0.

    A difference leaves dust of rounding, so what does not exist is set to 0.
    """
    other = dr.select((bsdf.flags() & flags.NOT_DIFFUSE) != 0, dr.maximum(value - diffuse, 0), 0)
    return diffuse, other


def sample_specular(
    layers: Layers, bsdf: Any, si: Any, sample1: Any, sample2: Any, active: Any
) -> tuple[Any, Any]:
    """A mi.BSDFSample3f of the specular lobes, and value over density of those lobes alone, mi.Color3f.

    sample1, sample2: mi.Float and mi.Point2f in [0, 1). The first chooses among lobes and blended materials.
    """
    if not layers.inseparable:
        return bsdf.sample(lobes_of(flags.NOT_DIFFUSE), si, sample1, sample2, active)
    bounce, weight = bsdf.sample(lobes_of(flags.ALL_LOBES), si, sample1, sample2, active)
    return bounce, _specular_weight(layers, bsdf, si, bounce, weight, active)


def eval_pdf_sample_specular(
    layers: Layers, bsdf: Any, si: Any, wo: Any, sample1: Any, sample2: Any, active: Any
) -> tuple[Any, Any, Any, Any]:
    """`sample_specular` with the value, cosine included, and the density of the lobes for another direction wo.

    Returns value, density, sample, value over density of the sample. The density is that by which the sample is drawn.
    """
    if not layers.inseparable:
        return bsdf.eval_pdf_sample(lobes_of(flags.NOT_DIFFUSE), si, wo, sample1, sample2, active)
    value, pdf, bounce, weight = bsdf.eval_pdf_sample(
        lobes_of(flags.ALL_LOBES), si, wo, sample1, sample2, active
    )
    value = split(bsdf, value, diffuse_lobe(layers, bsdf, si, wo, active))[1]
    return value, pdf, bounce, _specular_weight(layers, bsdf, si, bounce, weight, active)


def _specular_weight(layers, bsdf, si, bounce, weight, active):
    """Weight of a sample of all lobes for the specular ones."""
    smooth = active & ~mi.has_flag(bounce.sampled_type, mi.BSDFFlags.Delta) & (bounce.pdf > 0)
    diffuse = diffuse_lobe(layers, bsdf, si, bounce.wo, smooth)
    return split(bsdf, weight, dr.select(smooth, diffuse * inverse(bounce.pdf), 0))[1]


def _principled_diffuse(bsdf, si, wo, active):
    """The diffuse lobe of `principled` alone, cosine included (Burley 2012, section 5.3; flatness: 2015, section 5.2).

    si, wo: turned to the front. Sheen and coats are other lobes.
    """
    number = lambda name: bsdf.eval_attribute_1(name, si, active & bsdf.has_attribute(name, active))  # noqa: E731
    rough = number("roughness")
    matte = (1 - number("metallic")) * (1 - number("spec_trans")) * (1 - 0.5 * number("diff_trans"))
    cos_i, cos_o = dr.maximum(si.wi.z, 0), dr.maximum(wo.z, 0)
    grazing_i, grazing_o = ((1 - c) ** 5 for c in (cos_i, cos_o))
    half = dr.dot(dr.normalize(si.wi + wo), wo)
    retro = 2 * rough * dr.square(half)
    lobe = (1 - 0.5 * grazing_i) * (1 - 0.5 * grazing_o)
    lobe += retro * (grazing_o + grazing_i + grazing_o * grazing_i * (retro - 1))
    inner = dr.lerp(1, 0.5 * retro, grazing_o) * dr.lerp(1, 0.5 * retro, grazing_i)
    flat = 1.25 * (inner * (inverse(cos_i + cos_o) - 0.5) + 0.5)
    base = bsdf.eval_attribute("base_color", si, active)
    value = base * matte * dr.lerp(lobe, flat, number("flatness")) * cos_o * dr.inv_pi
    return dr.select(active & (cos_i > 0) & (cos_o > 0), value, 0)
