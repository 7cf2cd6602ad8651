"""Paths that follow the glossy lobe alone and end on the lightmap."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import drjit as dr
import mitsuba as mi

from gibench.baselines.lightmap.lookup import Lightmap
from gibench.rendering import flags
from gibench.rendering.light_sampling import emission, emission_weight, mis_weight, sample_light
from gibench.rendering.lobes import eval_pdf_sample_specular


def _scatter(scene, portals, layers, sampler, si, bsdf, active):
    """One light sample and one sample of the specular lobes at a hit.

    Returns what the light sample adds, the next ray, its weight, density, and whether it is a mirror's.
    """
    lit = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
    light = sample_light(scene, portals, None, si, mi.UInt32(0), sampler, lit)
    value, value_pdf, bounce, weight = eval_pdf_sample_specular(
        layers, bsdf, si, si.to_local(light.direction), sampler.next_1d(), sampler.next_2d(), active
    )
    mis = dr.select(light.delta, 1, mis_weight(light.pdf, value_pdf))
    direct = dr.select(lit & (light.pdf > 0), value * light.weight * mis, 0)
    delta = mi.has_flag(bounce.sampled_type, mi.BSDFFlags.Delta)
    return direct, si.spawn_ray(si.to_world(bounce.wo)), weight, bounce.pdf, delta


@dr.syntax
def glossy_radiance(scene, portals, layers, lightmap: Lightmap, sampler, si, bsdf, active, samples, bounces):
    """Radiance that hits reflect towards si.wi by their glossy lobe, mi.Color3f, the mean of `samples` paths.

    scene: mitsuba.Scene. portals, layers: those of `Scene`, so that lights are sampled as by the path tracer.
    sampler: mi.Sampler with a lane a hit. samples, bounces: mi.UInt32, opaque. At every hit of a path there is what
    it emits, which next-event estimation at the hit before shares, and its diffuse light from the lightmap; then,
    up to `bounces` glossy reflections, its glossy lobe. Exactly 0 where there is no such lobe.
    """
    glossy = active & ((bsdf.flags() & flags.NOT_DIFFUSE) != 0)
    total = mi.Spectrum(0)
    done = mi.UInt32(0)

    while glossy & (done < samples):
        direct, ray, throughput, pdf, delta = _scatter(scene, portals, layers, sampler, si, bsdf, glossy)
        total += dr.select(dr.all(dr.isfinite(direct)), direct, 0)
        reference = mi.Interaction3f(si)
        bounce = mi.UInt32(1)
        alive = glossy & (dr.max(throughput) > 0)

        while alive:
            preliminary = scene.ray_intersect_preliminary(ray, coherent=False, active=alive)
            hit = preliminary.compute_surface_interaction(ray, mi.RayFlags.All, alive)
            mis = emission_weight(scene, portals, None, hit, reference, mi.UInt32(0), pdf, delta, alive)
            emitted = emission(scene, hit, alive) * mis
            gained = throughput * (emitted + lightmap.diffuse(hit, preliminary, alive))

            there = hit.bsdf(ray)
            alive &= hit.is_valid() & (bounce < bounces) & ((there.flags() & flags.NOT_DIFFUSE) != 0)
            direct, ray, weight, pdf, delta = _scatter(scene, portals, layers, sampler, hit, there, alive)
            gained += throughput * direct
            total += dr.select(dr.all(dr.isfinite(gained)), gained, 0)
            throughput *= weight
            reference = mi.Interaction3f(hit)
            bounce += 1
            alive &= dr.max(throughput) > 0
        done += 1

    return total / mi.Float(dr.maximum(samples, 1))
