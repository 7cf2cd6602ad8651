"""The factorized path tracer: one path gives all five radiance parts.

The first hit is handled outside the loop. There the diffuse lobe is evaluated on its own, so a path carries two
weights, one for the diffuse reflection and one for everything else; the rest of the path is shared by both. What the
second vertex emits is direct light, all that comes later is indirect.

Multiple importance sampling with the balance-heuristic power 2 (Veach 1997, section 9.2.4), next-event
estimation at every vertex, Russian roulette from `RR_DEPTH` on.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.rendering.backend import is_scalar

RR_DEPTH = 2
"""Scattering events after which Russian roulette may end a path. Variance times time over three furnished rooms is 7 to
17 % below that of 5, the value of Mitsuba's `path`."""

SMALLEST = 1.2e-38
"""The smallest normal float32."""

RR_CAP = 0.95
"""Largest survival probability, so that a path in a white furnace ends too."""


@dataclass
class PathSample:
    """What one path a lane brings home: (lanes,) arrays of mi.Color3f, radiance in W·m⁻²·sr⁻¹.

    albedo and normal (world space, towards the viewer) of the first hit are None unless asked for.
    """

    emission: Any
    direct_diffuse: Any
    direct_specular: Any
    indirect_diffuse: Any
    indirect_specular: Any
    albedo: Any = None
    normal: Any = None


def _inverse(x):
    """1/x for x ≥ 0, where 0 gives something huge yet finite."""
    return dr.rcp(dr.maximum(x, SMALLEST))


def mis_weight(pdf_a, pdf_b):
    """Power heuristic for a sample drawn with `pdf_a`; 0 where it could not be drawn.

    As a ratio, since the squares of densities near a mirror's overflow.
    """
    return dr.select(pdf_a > 0, dr.rcp(1 + dr.square(pdf_b * _inverse(pdf_a))), 0)


_DIFFUSE = mi.BSDFFlags.DiffuseReflection
NOT_DIFFUSE = int(mi.BSDFFlags.All) & ~int(_DIFFUSE)
"""Mask of all lobes that count as specular."""


def _split(bsdf, value, diffuse):
    """A BSDF's value as the share of its diffuse reflection and that of everything else, both ≥ 0.

    A difference leaves dust of rounding, so what does not exist is set to 0.
    """
    other = dr.select((bsdf.flags() & NOT_DIFFUSE) != 0, dr.maximum(value - diffuse, 0), 0)
    return diffuse, other


@cache
def _black():
    return mi.load_dict({"type": "diffuse", "reflectance": 0.0})


def bsdf_at(si, ray):
    """The BSDF at a hit. Where there is none the scalar variant has a null object, on which no call may be made."""
    return _black() if is_scalar() and not si.is_valid() else si.bsdf(ray)


def shading_normal(si):
    """On the side of the geometric normal, also where a mesh brings normals that contradict its winding."""
    return dr.mulsign(si.sh_frame.n, dr.dot(si.sh_frame.n, si.n))


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
    flat = 1.25 * (inner * (_inverse(cos_i + cos_o) - 0.5) + 0.5)
    base = bsdf.eval_attribute("base_color", si, active)
    value = base * matte * dr.lerp(lobe, flat, number("flatness")) * cos_o * dr.inv_pi
    return dr.select(active & (cos_i > 0) & (cos_o > 0), value, 0)


def _diffuse_lobe(layers, bsdf, context, si, wo, active):
    """The diffuse reflection of a material, cosine included.

    `principled` evaluates all of its lobes whichever it is asked for, so what it adds is put right by hand.
    """
    value = bsdf.eval(context, si, wo, active)
    if layers is None or not layers.principled:
        return value
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


def _emission(scene, si, active):
    emitter = si.emitter(scene)
    # None only in the scalar variant, where an array of pointers would hold a null.
    return mi.Spectrum(0) if emitter is None else emitter.eval(si, active)


def _emission_weight(scene, portals, si, reference, pdf, delta, active):
    """Weight of emission met by sampling the BSDF, against sampling the light from `reference`."""
    emitter = si.emitter(scene)
    if emitter is None:
        return mi.Float(0)
    towards = mi.DirectionSample3f(scene, si, reference)
    active = active & (delta ^ True)
    light_pdf = scene.pdf_emitter_direction(reference, towards, active)
    if portals is not None:
        by_portal = dr.select(emitter == portals.environment, portals.density(reference.p, towards.d), 0)
        light_pdf = dr.lerp(light_pdf, by_portal, portals.share)
    return mis_weight(pdf, light_pdf)


def _sample_light(scene, portals, si, u, active):
    """Samples a direction to a light that si sees.

    Returns the direction, its density per steradian (0 where there is no light), whether nothing but this could have
    found it, and radiance over density.
    """
    if portals is None:
        sample, light = scene.sample_emitter_direction(si, u, True, active)
        return sample.d, sample.pdf, sample.delta, light
    share = portals.share
    entering = active & (u.x < share)
    u = mi.Point2f(dr.select(entering, u.x / share, (u.x - share) / (1 - share)), u.y)
    sample, light = scene.sample_emitter_direction(si, u, False, active & (entering ^ True))
    through = portals.sample(si.p, u)
    entering &= dr.any(through != 0)
    radiance = light * sample.pdf
    direction = dr.select(entering, through, sample.d)
    ray = si.spawn_ray_to(sample.p)
    ray = dr.select(entering, si.spawn_ray(direction), ray)

    # One density for both ways to the environment.
    outside = dr.zeros(mi.DirectionSample3f)
    outside.d = direction
    outside.emitter = portals.environment
    pdf = dr.select(entering, scene.pdf_emitter_direction(si, outside, entering), sample.pdf)
    sky = dr.zeros(mi.SurfaceInteraction3f)
    sky.wi = -direction
    radiance = dr.select(entering, portals.environment.eval(sky, entering), radiance)
    to_environment = entering | (sample.emitter == portals.environment)
    by_portal = dr.select(to_environment, portals.density(si.p, direction), 0)
    delta = sample.delta & (entering ^ True)
    mixed = dr.lerp(pdf, by_portal, share)
    chosen = active & (mixed > 0) & (entering | (sample.pdf > 0))
    chosen &= scene.ray_test(ray, chosen) ^ True
    return direction, dr.select(chosen, mixed, 0), delta, dr.select(chosen, radiance * _inverse(mixed), 0)


@dr.syntax
def _indirect(scene, portals, sampler, ray, reference, pdf, delta, weight, eta, active, max_depth):
    """Follows a path from its first bounce on.

    reference: the first hit (mi.Interaction3f); pdf, delta: of the direction taken there; weight: throughput of the
    first bounce over both lobes, for Russian roulette. Returns emission met right after the first bounce (direct
    light) and everything later, both per unit of first-bounce throughput.
    """
    context = mi.BSDFContext()
    ray = mi.Ray3f(ray)
    reference = mi.Interaction3f(reference)
    pdf, delta = mi.Float(pdf), mi.Bool(delta)
    weight, eta, active = mi.Spectrum(weight), mi.Float(eta), mi.Bool(active)
    direct, later = mi.Spectrum(0), mi.Spectrum(0)
    throughput = mi.Spectrum(1)
    depth = mi.UInt32(1)

    while active:
        si = scene.ray_intersect(ray, mi.RayFlags.All, False, active)

        # Emission at this vertex, weighted against the light sampling of the vertex before it.
        share = _emission_weight(scene, portals, si, reference, pdf, delta, active)
        seen = throughput * _emission(scene, si, active) * share
        direct += dr.select(depth == 1, seen, 0)
        later += dr.select(depth == 1, 0, seen)

        active &= si.is_valid() & (depth < max_depth)
        bsdf = bsdf_at(si, ray)

        # Light sampling.
        lit = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        direction, light_pdf, only_so, light = _sample_light(scene, portals, si, sampler.next_2d(), lit)
        lit &= light_pdf != 0
        to_light = si.to_local(direction)
        value, value_pdf, bounce, bounce_weight = bsdf.eval_pdf_sample(
            context, si, to_light, sampler.next_1d(), sampler.next_2d(), active
        )
        value = si.to_world_mueller(value, -to_light, si.wi)
        share = dr.select(only_so, 1, mis_weight(light_pdf, value_pdf))
        later += dr.select(lit, throughput * value * light * share, 0)

        # The next direction.
        ray = si.spawn_ray(si.to_world(bounce.wo))
        throughput *= si.to_world_mueller(bounce_weight, -bounce.wo, si.wi)
        eta *= bounce.eta
        reference = mi.Interaction3f(si)
        pdf = bounce.pdf
        delta = mi.has_flag(bounce.sampled_type, mi.BSDFFlags.Delta)
        depth += 1

        survival = dr.minimum(dr.max(throughput * weight) * dr.square(eta), RR_CAP)
        roulette = depth >= RR_DEPTH
        active &= survival > 0
        active &= (roulette ^ True) | (sampler.next_1d() < survival)
        throughput *= dr.select(roulette, _inverse(survival), 1)

    return direct, later


def scatter_paths(
    scene,
    sampler,
    si,
    bsdf,
    active,
    *,
    max_depth: int,
    lobes: str = "all",
    portals: Any = None,
    layers: Any = None,
) -> PathSample:
    """Traces one path a lane from points that light is reflected at, and sorts what they send along si.wi.

    scene: mitsuba.Scene. sampler: from `sampling`. si: mi.SurfaceInteraction3f, bsdf: its material. max_depth: largest
    number of scattering events, that at si included. lobes: "all"; "diffuse" or "specular" reflect by that lobe
    alone, with all samples, and leave the other at 0. portals: `Scene.portals`, for less noise by daylight. layers:
    `Scene.layers`, without which all of `principled` counts as diffuse. emission of the result is 0.
    """
    by_hand = layers is not None and layers.principled
    mask = {"all": int(mi.BSDFFlags.All), "diffuse": int(_DIFFUSE), "specular": NOT_DIFFUSE}[lobes]
    # What ignores the mask is sampled whole and taken apart.
    asked = mi.BSDFContext(mi.TransportMode.Radiance, int(mi.BSDFFlags.All) if by_hand else mask)
    diffuse = mi.BSDFContext(mi.TransportMode.Radiance, int(_DIFFUSE))
    active = active & si.is_valid() & ((bsdf.flags() & mask) != 0) & (max_depth >= 1)

    # The same calls as in the loop, and one more for the diffuse lobe alone: kernels stay small.
    lit = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
    direction, light_pdf, only_so, light = _sample_light(scene, portals, si, sampler.next_2d(), lit)
    lit &= light_pdf != 0
    to_light = si.to_local(direction)
    value, value_pdf, bounce, weight = bsdf.eval_pdf_sample(
        asked, si, to_light, sampler.next_1d(), sampler.next_2d(), active
    )
    share = dr.select(only_so, 1, mis_weight(light_pdf, value_pdf))
    light = dr.select(lit, light * share, 0)

    delta = mi.has_flag(bounce.sampled_type, mi.BSDFFlags.Delta)
    none = mi.Spectrum(0)
    if lobes == "all" or by_hand:
        value_diffuse, value_other = _split(
            bsdf, value, _diffuse_lobe(layers, bsdf, diffuse, si, to_light, lit)
        )
        smooth = active & (delta ^ True) & (bounce.pdf > 0)
        bounce_diffuse = _diffuse_lobe(layers, bsdf, diffuse, si, bounce.wo, smooth)
        bounce_diffuse *= dr.select(smooth, _inverse(bounce.pdf), 0)
        weight_diffuse, weight_other = _split(bsdf, weight, bounce_diffuse)
        if lobes == "diffuse":
            value_other, weight_other = none, none
        elif lobes == "specular":
            value_diffuse, weight_diffuse = none, none
    elif lobes == "diffuse":
        value_diffuse, value_other, weight_diffuse, weight_other = value, none, weight, none
    else:
        value_diffuse, value_other, weight_diffuse, weight_other = none, value, none, weight
    active &= dr.max(weight) > 0

    seen, later = _indirect(
        scene,
        portals,
        sampler.independent,
        si.spawn_ray(si.to_world(bounce.wo)),
        mi.Interaction3f(si),
        bounce.pdf,
        delta,
        weight,
        bounce.eta,
        active,
        max_depth,
    )
    return PathSample(
        mi.Spectrum(0),
        light * value_diffuse + weight_diffuse * seen,
        light * value_other + weight_other * seen,
        weight_diffuse * later,
        weight_other * later,
    )


def trace_paths(
    scene,
    sampler,
    ray,
    *,
    max_depth: int,
    guides: bool = False,
    portals: Any = None,
    layers: Any = None,
) -> PathSample:
    """Traces one path a lane and sorts its radiance.

    scene: mitsuba.Scene. sampler: from `sampling`. ray: mi.Ray3f. max_depth: largest number of scattering events, ≥ 0
    (Mitsuba's `path` counts segments: its max_depth is one more). guides: whether first-hit albedo and normal are
    returned too. portals, layers: those of the `Scene`, as for `scatter_paths`.
    """
    si = scene.ray_intersect(ray, mi.RayFlags.All, True)
    bsdf = bsdf_at(si, ray)
    result = scatter_paths(
        scene, sampler, si, bsdf, mi.Bool(True), max_depth=max_depth, portals=portals, layers=layers
    )
    result.emission = _emission(scene, si, True)
    if guides:
        # On a conductor this is a value of its lobe and may exceed 1; the denoiser wants [0, 1].
        result.albedo = dr.select(si.is_valid(), dr.clip(bsdf.eval_diffuse_reflectance(si), 0, 1), 0)
        result.normal = dr.select(si.is_valid(), dr.mulsign(shading_normal(si), dr.dot(si.n, -ray.d)), 0)
    return result
