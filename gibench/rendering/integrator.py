"""The factorized path tracer: one path gives all five radiance parts.

The first hit is handled outside the loop. There the diffuse lobe is evaluated on its own, so a path carries two
weights, one for the diffuse reflection and one for everything else; the rest of the path is shared by both. What the
second vertex emits is direct light, all that is scattered there is indirect.

Multiple importance sampling with the balance-heuristic power 2 (Veach 1997, section 9.2.4), next-event
estimation at every vertex, Russian roulette from `RR_DEPTH` on, or by what a guide expects.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol

import drjit as dr
import mitsuba as mi

from gibench.rendering import flags
from gibench.rendering.backend import is_scalar
from gibench.rendering.light_sampling import (
    LightSample,
    emission,
    emission_weight,
    inverse,
    mis_weight,
    sample_light,
)
from gibench.rendering.lobes import diffuse_lobe, split

RR_DEPTH = 3
"""Scattering events after which Russian roulette may end a path of which no guide knows what it will bring. In ten
furnished rooms variance times time is .83, .77 and .75 of that of Mitsuba's `path`, in the mean, with 2, 3 and 4."""

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


@dataclass
class Scattering:
    """What a vertex reflects of a light, and how the path goes on from it.

    light: the sample of a light. to_light: its direction, in the frame of the vertex; lit: whether there is light from
    there. incident: its radiance over density, with its MIS weight; value: of the BSDF for it, cosine included; both 0
    where there is none. direction: of the bounce, world space. weight: BSDF value over density. expected: the same as
    the BSDF alone would sample it. pdf: per steradian. delta: whether the lobe is. eta: relative index of refraction.
    guided: whether a guide has chosen the direction.
    """

    light: LightSample
    to_light: Any
    lit: Any
    incident: Any
    value: Any
    direction: Any
    weight: Any
    expected: Any
    pdf: Any
    delta: Any
    eta: Any
    guided: Any


class Recorder(Protocol):
    """Told of the vertices of paths while a kernel is traced. Values are per unit of throughput at the path's start."""

    def met(self, emitter: Any, emitted: Any, depth: Any, active: Any) -> None:
        """A ray has met an emitter (pointer) after `depth` scattering events. emitted: weighted radiance."""

    def vertex(
        self,
        row: Any,
        si: Any,
        bsdf: Any,
        scattering: Scattering,
        throughput: Any,
        before: Any,
        depth: Any,
        active: Any,
    ) -> None:
        """A path is scattered.

        row: of the guide. throughput: up to the vertex; before: radiance found up to it, that of its light sample
        included. depth: scattering events, this one included.
        """


class PathRecorder(Recorder, Protocol):
    """Told of the first two events too, in `scatter_paths` and `trace_paths`."""

    def seen(self, emitter: Any, emitted: Any) -> None:
        """The camera's ray has met an emitter (pointer)."""

    def first(
        self,
        si: Any,
        bsdf: Any,
        scattering: Scattering,
        lit: tuple[Any, Any],
        weights: tuple[Any, Any],
        active: Any,
    ) -> None:
        """A path is scattered first.

        lit: radiance of the light sample that is reflected by the diffuse lobe, and by all others; weights: with which
        these lobes reflect the rest of the path.
        """


def _guide_row(guide, si, sampler, active):
    """Row of a guide at a vertex; 0 without one. sampler: independent."""
    return mi.UInt32(0) if guide is None else guide.row(si, sampler, active)


def _scatter(
    scene, portals, guide, context, si, bsdf, row, sampler, active, deeper, *, diffuse: bool = True
) -> Scattering:
    """A sample of the lights and one of the next direction, by one evaluation of the BSDF: kernels stay small.

    context: of the lobes that are asked for. row: of the guide at si. deeper: whether another scattering event may
    follow. diffuse: whether the diffuse lobe is among those that count; the guide chooses no direction of the others.
    """
    lit = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
    light = sample_light(scene, portals, guide, si, row, sampler, lit, deeper)
    lit &= light.pdf != 0
    to_light = si.to_local(light.direction)
    value, light_bounce_pdf, bounce, weight = bsdf.eval_pdf_sample(
        context, si, to_light, sampler.next_1d(), sampler.next_2d(), active
    )
    # Where the sample has failed, another direction may be taken in its place.
    expected = dr.select(dr.max(weight) > 0, weight, 1)
    if guide is None or not guide.directions:
        direction, pdf, eta = si.to_world(bounce.wo), bounce.pdf, bounce.eta
        delta, guided = mi.has_flag(bounce.sampled_type, mi.BSDFFlags.Delta), mi.Bool(False)
    else:
        fraction = guide.fraction(row, bsdf, active & mi.Bool(diffuse))
        light_bounce_pdf = guide.mixed_density(row, fraction, light.direction, light_bounce_pdf, lit)
        direction, weight, pdf, delta, eta, guided = guide.bounce(
            context, si, bsdf, row, fraction, bounce, weight, sampler, active
        )
    mis = dr.select(light.delta, 1, mis_weight(light.pdf, light_bounce_pdf))
    incident, value = dr.select(lit, light.weight * mis, 0), dr.select(lit, value, 0)
    return Scattering(
        light, to_light, lit, incident, value, direction, weight, expected, pdf, delta, eta, guided
    )


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
    reflected=None,
):
    """Follows paths along `ray` to their end. All of it is per unit of throughput at its start.

    reference: where the ray starts (mi.Interaction3f); row: of the guide there; pdf, delta: of the direction taken;
    expected: throughput so far as the BSDFs alone would sample it, for Russian roulette; eta: relative index of
    refraction so far; depth: scattering events so far; reflected: radiance that the guide expects where the path was
    scattered first, per unit of throughput, for Russian roulette, or None. Returns the emission at the end of the ray,
    and all light that is scattered there towards its start.
    """
    context = mi.BSDFContext()
    ray = mi.Ray3f(ray)
    reference = mi.Interaction3f(reference)
    row, pdf, delta = mi.UInt32(row), mi.Float(pdf), mi.Bool(delta)
    expected, eta, active = mi.Spectrum(expected), mi.Float(eta), mi.Bool(active)
    first_emission, scattered = mi.Spectrum(0), mi.Spectrum(0)
    throughput = mi.Spectrum(1)
    depth = mi.UInt32(depth)
    mirror = mi.UInt32(0)
    first = mi.Bool(True)

    while active:
        si = scene.ray_intersect(ray, mi.RayFlags.All, False, active)

        # Emission at this vertex, weighted against the light sampling of the vertex before it.
        weight = emission_weight(scene, portals, guide, si, reference, row, pdf, delta, active, mirror)
        emitted = throughput * emission(scene, si, active) * weight
        if dr.hint(recorder is not None, mode="scalar"):
            recorder.met(si.emitter(scene), emitted, depth, active)
        first_emission += dr.select(first, emitted, 0)
        scattered += dr.select(first, 0, emitted)
        first = mi.Bool(False)

        active &= si.is_valid() & (depth < max_depth)
        bsdf = bsdf_at(si, ray)

        # Light sampling, and the next direction.
        here = _guide_row(guide, si, sampler, active)
        deeper = depth + 1 < max_depth
        scattering = _scatter(scene, portals, guide, context, si, bsdf, here, sampler, active, deeper)
        scattered += throughput * scattering.value * scattering.incident
        depth += 1
        if dr.hint(recorder is not None, mode="scalar"):
            recorder.vertex(
                here,
                si,
                bsdf,
                scattering,
                throughput,
                first_emission + scattered,
                depth,
                active,
            )
        ray = si.spawn_ray(scattering.direction)
        expected *= scattering.expected
        eta *= scattering.eta
        survival, roulette = _roulette(guide, here, throughput, reflected, expected, eta, depth, active)
        throughput *= scattering.weight
        reference, shown = _reference_after(guide, si, scattering, reference, delta | (mirror > 0), active)
        row, pdf = dr.select(shown > 0, row, here), dr.select(shown > 0, pdf, scattering.pdf)
        delta, mirror = scattering.delta & (shown == 0), shown

        active &= (survival > 0) & (dr.max(throughput) > 0)
        active &= (roulette ^ True) | (sampler.next_1d() < survival)
        spared = dr.select(roulette, inverse(survival), 1)
        throughput *= spared
        expected *= spared

    return first_emission, scattered


def _roulette(guide, row, throughput, reflected, expected, eta, depth, active):
    """Probability with which a path goes on from where it has been scattered, and whether it is asked at all.

    row: of the guide there. throughput: up to there. expected, eta, depth: as in `_follow`, this event included.
    """
    # What a path is expected to carry: a guided one to where much light comes from carries little for each, and must
    # not be ended for it.
    survival, asked = dr.max(expected) * dr.square(eta), depth >= RR_DEPTH
    if guide is not None and reflected is not None:
        by_guide = guide.survival(row, dr.max(throughput), reflected, active)
        survival, asked = dr.select(by_guide > 0, by_guide, survival), asked | (by_guide > 0)
    return dr.minimum(survival, RR_CAP), asked


def _reference_after(guide, si, scattering, before, no_image, active):
    """Where the light samples start that the next emission is weighed against, and the guide's mirror that shows them.

    At si, with mirror 0; where a mirror has scattered the path, at the image of the reference before. no_image: whether
    nothing was sampled there that the mirror could show.
    """
    start, mirror = mi.Interaction3f(si), mi.UInt32(0)
    if guide is not None and guide.images is not None:
        mirror = guide.images.at(si, active & scattering.delta & (no_image ^ True))
        start.p = dr.select(mirror > 0, guide.images.point(mirror, before.p, mirror > 0), start.p)
    return start, mirror


def follow_paths(scene, sampler, ray, *, max_depth: int, portals=None, guide=None, recorder=None):
    """Light along rays, one path each: emission at the first hit, and all that it reflects (two mi.Color3f).

    sampler: independent. recorder: a `Recorder`.
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
    recorder: Any = None,
) -> PathSample:
    """Traces one path a lane from points that light is reflected at, and sorts what they send along si.wi.

    scene: mitsuba.Scene. sampler: from `sampling`. si: mi.SurfaceInteraction3f, bsdf: its material. max_depth: largest
    number of scattering events, that at si included. lobes: "all"; "diffuse" or "specular" reflect by that lobe
    alone, with all samples, and leave the other at 0. portals: `Scene.portals`, for less noise by daylight. layers:
    `Scene.layers`, without which all of `principled` counts as diffuse. guide: `Scene.guide`, for less noise.
    recorder: a `PathRecorder`, or None. emission of the result is 0.
    """
    by_hand = layers is not None and (layers.inseparable or layers.masked)
    mask = {"all": flags.ALL_LOBES, "diffuse": flags.DIFFUSE, "specular": flags.NOT_DIFFUSE}[lobes]
    # What ignores the lobes that are asked for is sampled whole and taken apart. So is a material with holes, whose
    # samples Mitsuba weighs wrongly (a coat four times) where the diffuse lobe alone is asked for.
    asked = mi.BSDFContext(mi.TransportMode.Radiance, flags.ALL_LOBES if by_hand else mask)
    active = active & si.is_valid() & ((bsdf.flags() & mask) != 0) & (max_depth >= 1)

    # The same as in the loop, and the diffuse lobe alone besides.
    row = _guide_row(guide, si, sampler.independent, active)
    deeper = mi.Bool(max_depth >= 2)
    scattering = _scatter(
        scene, portals, guide, asked, si, bsdf, row, sampler, active, deeper, diffuse=lobes != "specular"
    )
    incident, value, weight = scattering.incident, scattering.value, scattering.weight

    none = mi.Spectrum(0)
    if lobes == "all" or by_hand:
        value_diffuse, value_other = split(
            bsdf, value, diffuse_lobe(layers, bsdf, si, scattering.to_light, scattering.lit)
        )
        smooth = active & (scattering.delta ^ True) & (scattering.pdf > 0)
        bounce_diffuse = diffuse_lobe(layers, bsdf, si, si.to_local(scattering.direction), smooth)
        bounce_diffuse *= dr.select(smooth, inverse(scattering.pdf), 0)
        weight_diffuse, weight_other = split(bsdf, weight, bounce_diffuse)
        if lobes == "diffuse":
            value_other, weight_other = none, none
        elif lobes == "specular":
            value_diffuse, weight_diffuse = none, none
    elif lobes == "diffuse":
        value_diffuse, value_other, weight_diffuse, weight_other = value, none, weight, none
    else:
        value_diffuse, value_other, weight_diffuse, weight_other = none, value, none, weight
    if recorder is not None:
        recorder.first(
            si,
            bsdf,
            scattering,
            (incident * value_diffuse, incident * value_other),
            (weight_diffuse, weight_other),
            active,
        )
    active &= dr.max(weight) > 0

    direct, indirect = _follow(
        scene,
        portals,
        guide,
        recorder,
        sampler.independent,
        si.spawn_ray(scattering.direction),
        mi.Interaction3f(si),
        row,
        scattering.pdf,
        scattering.delta,
        scattering.expected,
        scattering.eta,
        1,
        active,
        max_depth,
        None if guide is None else guide.sent(row, active) * inverse(dr.max(weight)),
    )
    # A mirror is a scattering event of its own.
    shown = mi.Bool(scattering.light.mirrored)
    straight, mirrored = dr.select(shown, 0, incident), dr.select(shown, incident, 0)
    return PathSample(
        mi.Spectrum(0),
        straight * value_diffuse + weight_diffuse * direct,
        straight * value_other + weight_other * direct,
        mirrored * value_diffuse + weight_diffuse * indirect,
        mirrored * value_other + weight_other * indirect,
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
    recorder: Any = None,
) -> PathSample:
    """Traces one path a lane and sorts its radiance.

    scene: mitsuba.Scene. sampler: from `sampling`. ray: mi.Ray3f. max_depth: largest number of scattering events, ≥ 0
    (Mitsuba's `path` counts segments: its max_depth is one more). guides: whether first-hit albedo and normal are
    returned too. portals, layers, guide: those of the `Scene`, recorder: as for `scatter_paths`.
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
        recorder=recorder,
    )
    result.emission = emission(scene, si, True)
    if recorder is not None:
        recorder.seen(si.emitter(scene), result.emission)
    if guides:
        # On a conductor this is a value of its lobe and may exceed 1; the denoiser wants [0, 1].
        result.albedo = dr.select(si.is_valid(), dr.clip(bsdf.eval_diffuse_reflectance(si), 0, 1), 0)
        result.normal = dr.select(si.is_valid(), dr.mulsign(shading_normal(si), dr.dot(si.n, -ray.d)), 0)
    return result
