"""Light samples at a vertex of a path, and their weight against emission that a bounce runs into.

Multiple importance sampling by the power heuristic (Veach 1997, section 9.2.4).
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

SMALLEST = 1.2e-38
"""The smallest normal float32."""


def inverse(x):
    """1/x for x ≥ 0, where 0 gives something huge yet finite."""
    return dr.rcp(dr.maximum(x, SMALLEST))


def mis_weight(pdf_a, pdf_b):
    """Power heuristic for a sample drawn with `pdf_a`; 0 where it could not be drawn.

    As a ratio, since the squares of densities near a mirror's overflow.
    """
    return dr.select(pdf_a > 0, dr.rcp(1 + dr.square(pdf_b * inverse(pdf_a))), 0)


@dataclass
class LightSample:
    """A direction to a light that the vertex sees.

    direction: unit, world space. pdf: density per steradian, 0 where there is no light. delta: whether the light is a
    point or a single direction, which no bounce meets. weight: radiance over density. emitter: pointer to the light.
    entering: whether it was found through a portal. mirrored: whether in a mirror, which is a scattering event more.
    light: number of the light, where a guide has chosen it.
    """

    direction: Any
    pdf: Any
    delta: Any
    weight: Any
    emitter: Any
    entering: Any
    mirrored: Any = False
    light: Any = None


def emission(scene, si, active):
    """Radiance that the surface at a hit, or the environment, emits towards the viewer."""
    emitter = si.emitter(scene)
    # None only in the scalar variant, where an array of pointers would hold a null.
    return mi.Spectrum(0) if emitter is None else emitter.eval(si, active)


def emission_weight(scene, portals, guide, si, reference, row, pdf, delta, active, mirror=0):
    """MIS weight of emission met by a bounce from `reference`, against `sample_light` there.

    row: of the guide at the reference. pdf, delta: of the bounce. mirror: of the guide's, that the bounce has met on
    its way; the reference is then its image.
    """
    emitter = si.emitter(scene)
    if emitter is None:
        return mi.Float(0)
    towards = mi.DirectionSample3f(scene, si, reference)
    active = active & (delta ^ True)
    if guide is not None:
        return mis_weight(pdf, guide.light_density(reference, row, emitter, towards, mirror, active))
    light_pdf = scene.pdf_emitter_direction(reference, towards, active)
    if portals is not None:
        by_portal = dr.select(emitter == portals.environment, portals.density(reference.p, towards.d), 0)
        light_pdf = dr.lerp(light_pdf, by_portal, portals.fraction)
    return mis_weight(pdf, light_pdf)


def sample_light(scene, portals, guide, si, row, sampler, active, deeper=True) -> LightSample:
    """Samples a light from si: of all alike, through the portals, or as the guide has it for its row.

    deeper: whether the path may have another scattering event, as light has that comes by way of a mirror.
    """
    if guide is not None:
        return guide.sample_light(scene, si, row, sampler, active, deeper)
    u = sampler.next_2d()
    if portals is None:
        sample, weight = scene.sample_emitter_direction(si, u, True, active)
        return LightSample(sample.d, sample.pdf, sample.delta, weight, sample.emitter, mi.Bool(False))
    fraction = portals.fraction
    entering = active & (u.x < fraction)
    u = mi.Point2f(dr.select(entering, u.x / fraction, (u.x - fraction) / (1 - fraction)), u.y)
    sample, light = scene.sample_emitter_direction(si, u, False, active & (entering ^ True))
    through = portals.sample(si.p, u)
    entering &= dr.any(through != 0)
    radiance = light * sample.pdf
    direction = dr.select(entering, through, sample.d)
    ray = si.spawn_ray_to(sample.p)
    ray = dr.select(entering, si.spawn_ray(direction), ray)

    # One density for both ways to the environment.
    sky, outside = portals.environment_from(direction, entering)
    pdf = dr.select(entering, scene.pdf_emitter_direction(si, outside, entering), sample.pdf)
    radiance = dr.select(entering, sky, radiance)
    to_environment = entering | (sample.emitter == portals.environment)
    by_portal = dr.select(to_environment, portals.density(si.p, direction), 0)
    delta = sample.delta & (entering ^ True)
    mixed = dr.lerp(pdf, by_portal, fraction)
    chosen = active & (mixed > 0) & (entering | (sample.pdf > 0))
    chosen &= scene.ray_test(ray, chosen) ^ True
    return LightSample(
        direction,
        dr.select(chosen, mixed, 0),
        delta,
        dr.select(chosen, radiance * inverse(mixed), 0),
        dr.select(entering, portals.environment, sample.emitter),
        entering,
    )
