"""The factorized path tracer: one path gives all five radiance parts.

The first hit is handled outside the loop. There the diffuse lobe is evaluated on its own, so a path carries two
weights, one for the diffuse reflection and one for everything else; the rest of the path is shared by both. What the
second vertex emits is direct light, all that is scattered there is indirect.

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

from gibench.rendering import flags
from gibench.rendering.backend import is_scalar
from gibench.rendering.light_sampling import emission, emission_weight, inverse, mis_weight, sample_light
from gibench.rendering.lobes import diffuse_lobe, split

RR_DEPTH = 2
"""Scattering events after which Russian roulette may end a path. Variance times time over three furnished rooms is 7 to
17 % below that of 5, the value of Mitsuba's `path`."""

RR_CAP = 0.95
"""Largest survival probability, so that a path in a white furnace ends too."""


@dataclass
class PathSample:
    """Radiance of one path a lane: (lanes,) arrays of mi.Color3f in W·m⁻²·sr⁻¹.

    albedo and normal (world space, towards the viewer) of the first hit are None unless asked for.
    """

    emission: Any
    direct_diffuse: Any
    direct_specular: Any
    indirect_diffuse: Any
    indirect_specular: Any
    albedo: Any = None
    normal: Any = None


@cache
def _black():
    return mi.load_dict({"type": "diffuse", "reflectance": 0.0})


def bsdf_at(si, ray):
    """The BSDF at a hit. Where there is none the scalar variant has a null object, on which no call may be made."""
    return _black() if is_scalar() and not si.is_valid() else si.bsdf(ray)


def shading_normal(si):
    """On the side of the geometric normal, also where a mesh brings normals that contradict its winding."""
    return dr.mulsign(si.sh_frame.n, dr.dot(si.sh_frame.n, si.n))


def _as_expected(weight):
    """A BSDF sample's weight, or 1 where it has failed: another direction may be taken in its place."""
    return dr.select(dr.max(weight) > 0, weight, 1)


@dr.syntax
def _follow(
    scene,
    portals,
    guide,
    recorder,
    sampler,
    ray,
    reference,
    row,
    pdf,
    delta,
    expected,
    eta,
    depth,
    active,
    max_depth,
):
    """Follows paths along `ray` to their end. All of it is per unit of throughput at its start.

    reference: where the ray starts (mi.Interaction3f); row: of the guide there; pdf, delta: of the direction taken;
    expected: throughput so far as the BSDFs alone would sample it, for Russian roulette; eta: relative index of
    refraction so far; depth: scattering events so far. Returns the emission at the end of the ray, and all
    light that is scattered there towards its start.
    """
    context = mi.BSDFContext()
    ray = mi.Ray3f(ray)
    reference = mi.Interaction3f(reference)
    row, pdf, delta = mi.UInt32(row), mi.Float(pdf), mi.Bool(delta)
    expected, eta, active = mi.Spectrum(expected), mi.Float(eta), mi.Bool(active)
    first_emission, scattered = mi.Spectrum(0), mi.Spectrum(0)
    throughput = mi.Spectrum(1)
    depth = mi.UInt32(depth)
    first = mi.Bool(True)

    while active:
        si = scene.ray_intersect(ray, mi.RayFlags.All, False, active)

        # Emission at this vertex, weighted against the light sampling of the vertex before it.
        weight = emission_weight(scene, portals, guide, si, reference, row, pdf, delta, active)
        emitted = throughput * emission(scene, si, active) * weight
        first_emission += dr.select(first, emitted, 0)
        scattered += dr.select(first, 0, emitted)
        first = mi.Bool(False)

        active &= si.is_valid() & (depth < max_depth)
        bsdf = bsdf_at(si, ray)

        # Light sampling.
        lit = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        if dr.hint(guide is not None, mode="scalar"):
            row = guide.row(si, sampler, active)
        light = sample_light(scene, portals, guide, si, row, sampler, lit)
        lit &= light.pdf != 0
        to_light = si.to_local(light.direction)
        value, light_bounce_pdf, bounce, bounce_weight = bsdf.eval_pdf_sample(
            context, si, to_light, sampler.next_1d(), sampler.next_2d(), active
        )
        if dr.hint(guide is not None, mode="scalar"):
            guide_fraction = guide.fraction(row, bsdf, active)
            light_bounce_pdf = guide.mixed_density(
                row, guide_fraction, light.direction, light_bounce_pdf, lit
            )
        value = si.to_world_mueller(value, -to_light, si.wi)
        weight = dr.select(light.delta, 1, mis_weight(light.pdf, light_bounce_pdf))
        reflected = dr.select(lit, value * light.weight * weight, 0)
        scattered += throughput * reflected

        # The next direction.
        bounce_weight = si.to_world_mueller(bounce_weight, -bounce.wo, si.wi)
        expected *= _as_expected(bounce_weight)
        pdf = bounce.pdf
        delta = mi.has_flag(bounce.sampled_type, mi.BSDFFlags.Delta)
        direction = si.to_world(bounce.wo)
        bounce_eta = bounce.eta
        if dr.hint(guide is not None, mode="scalar"):
            direction, bounce_weight, pdf, delta, bounce_eta = guide.bounce(
                context, si, bsdf, row, guide_fraction, bounce, bounce_weight, sampler, active
            )
        depth += 1
        if dr.hint(recorder is not None, mode="scalar"):
            recorder.vertex(
                row,
                si,
                bsdf,
                direction,
                pdf,
                delta,
                throughput,
                first_emission + scattered,
                light.light,
                reflected,
                depth,
                active,
            )
        ray = si.spawn_ray(direction)
        throughput *= bounce_weight
        eta *= bounce_eta
        reference = mi.Interaction3f(si)

        # The roulette looks at what a path is expected to carry: a guided path to where much light comes from carries
        # little for each, and must not be ended for it.
        survival = dr.minimum(dr.max(expected) * dr.square(eta), RR_CAP)
        roulette = depth >= RR_DEPTH
        active &= (survival > 0) & (dr.max(throughput) > 0)
        active &= (roulette ^ True) | (sampler.next_1d() < survival)
        spared = dr.select(roulette, inverse(survival), 1)
        throughput *= spared
        expected *= spared

    return first_emission, scattered


def follow_paths(scene, sampler, ray, *, max_depth: int, portals=None, guide=None, recorder=None):
    """Light along rays, one path each: emission at the first hit, and all that it reflects (two mi.Color3f).

    sampler: independent. recorder: told of every vertex that scatters, see `guiding.learning`.
    """
    nowhere = dr.zeros(mi.Interaction3f)
    start = {
        "reference": nowhere,
        "row": 0,
        "pdf": 1.0,
        "delta": True,
        "expected": 1.0,
        "eta": 1.0,
        "depth": 0,
    }
    return _follow(scene, portals, guide, recorder, sampler, ray, **start, active=True, max_depth=max_depth)


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
    guide: Any = None,
) -> PathSample:
    """Traces one path a lane from points that light is reflected at, and sorts what they send along si.wi.

    scene: mitsuba.Scene. sampler: from `sampling`. si: mi.SurfaceInteraction3f, bsdf: its material. max_depth: largest
    number of scattering events, that at si included. lobes: "all"; "diffuse" or "specular" reflect by that lobe
    alone, with all samples, and leave the other at 0. portals: `Scene.portals`, for less noise by daylight. layers:
    `Scene.layers`, without which all of `principled` counts as diffuse. guide: `Scene.guide`, for less noise. emission
    of the result is 0.
    """
    by_hand = layers is not None and (layers.principled or layers.masked)
    mask = {"all": flags.ALL_LOBES, "diffuse": flags.DIFFUSE, "specular": flags.NOT_DIFFUSE}[lobes]
    # What ignores the lobes that are asked for is sampled whole and taken apart. So is a material with holes, whose
    # samples Mitsuba weighs wrongly (a coat four times) where the diffuse lobe alone is asked for.
    asked = mi.BSDFContext(mi.TransportMode.Radiance, flags.ALL_LOBES if by_hand else mask)
    active = active & si.is_valid() & ((bsdf.flags() & mask) != 0) & (max_depth >= 1)

    # The same calls as in the loop, and one more for the diffuse lobe alone: kernels stay small.
    lit = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
    row = mi.UInt32(0) if guide is None else guide.row(si, sampler.independent, active)
    light = sample_light(scene, portals, guide, si, row, sampler, lit)
    lit &= light.pdf != 0
    to_light = si.to_local(light.direction)
    value, light_bounce_pdf, bounce, weight = bsdf.eval_pdf_sample(
        asked, si, to_light, sampler.next_1d(), sampler.next_2d(), active
    )
    direction, pdf, eta, expected = si.to_world(bounce.wo), bounce.pdf, bounce.eta, _as_expected(weight)
    delta = mi.has_flag(bounce.sampled_type, mi.BSDFFlags.Delta)
    if guide is not None:
        guide_fraction = guide.fraction(row, bsdf, active)
        light_bounce_pdf = guide.mixed_density(row, guide_fraction, light.direction, light_bounce_pdf, lit)
        direction, weight, pdf, delta, eta = guide.bounce(
            asked, si, bsdf, row, guide_fraction, bounce, weight, sampler, active
        )
    mis = dr.select(light.delta, 1, mis_weight(light.pdf, light_bounce_pdf))
    incident = dr.select(lit, light.weight * mis, 0)

    none = mi.Spectrum(0)
    if lobes == "all" or by_hand:
        value_diffuse, value_other = split(bsdf, value, diffuse_lobe(layers, bsdf, si, to_light, lit))
        smooth = active & (delta ^ True) & (pdf > 0)
        bounce_diffuse = diffuse_lobe(layers, bsdf, si, si.to_local(direction), smooth)
        bounce_diffuse *= dr.select(smooth, inverse(pdf), 0)
        weight_diffuse, weight_other = split(bsdf, weight, bounce_diffuse)
        if lobes == "diffuse":
            value_other, weight_other = none, none
        elif lobes == "specular":
            value_diffuse, weight_diffuse = none, none
    elif lobes == "diffuse":
        value_diffuse, value_other, weight_diffuse, weight_other = value, none, weight, none
    else:
        value_diffuse, value_other, weight_diffuse, weight_other = none, value, none, weight
    active &= dr.max(weight) > 0

    direct, indirect = _follow(
        scene,
        portals,
        guide,
        None,
        sampler.independent,
        si.spawn_ray(direction),
        mi.Interaction3f(si),
        row,
        pdf,
        delta,
        expected,
        eta,
        1,
        active,
        max_depth,
    )
    return PathSample(
        mi.Spectrum(0),
        incident * value_diffuse + weight_diffuse * direct,
        incident * value_other + weight_other * direct,
        weight_diffuse * indirect,
        weight_other * indirect,
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
    guide: Any = None,
) -> PathSample:
    """Traces one path a lane and sorts its radiance.

    scene: mitsuba.Scene. sampler: from `sampling`. ray: mi.Ray3f. max_depth: largest number of scattering events, ≥ 0
    (Mitsuba's `path` counts segments: its max_depth is one more). guides: whether first-hit albedo and normal are
    returned too. portals, layers, guide: those of the `Scene`, as for `scatter_paths`.
    """
    si = scene.ray_intersect(ray, mi.RayFlags.All, True)
    bsdf = bsdf_at(si, ray)
    result = scatter_paths(
        scene,
        sampler,
        si,
        bsdf,
        mi.Bool(True),
        max_depth=max_depth,
        portals=portals,
        layers=layers,
        guide=guide,
    )
    result.emission = emission(scene, si, True)
    if guides:
        # On a conductor this is a value of its lobe and may exceed 1; the denoiser wants [0, 1].
        result.albedo = dr.select(si.is_valid(), dr.clip(bsdf.eval_diffuse_reflectance(si), 0, 1), 0)
        result.normal = dr.select(si.is_valid(), dr.mulsign(shading_normal(si), dr.dot(si.n, -ray.d)), 0)
    return result
