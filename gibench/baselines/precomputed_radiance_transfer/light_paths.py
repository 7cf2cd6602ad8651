"""Paths from points of surfaces out to where light comes from.

A path that leaves the scene stands for light of all harmonics at once: what arrives at its start along its first ray is
its throughput times the radiance of the environment in its last direction, whatever that is. So nothing is rendered
for each harmonic, and no signed light is taken apart.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.rendering.integrator import RR_CAP, RR_DEPTH
from gibench.rendering.light_sampling import inverse
from gibench.rendering.sampling import StratifiedSampler
from gibench.rendering.scene import Scene

NEAR = 0.01
"""Metres: what ends sooner lies in a gap that no camera looks into, as below a rug."""

FLAT = 0.5
"""Share of uniform directions; the others are cosine-distributed. Of either kind alone, what arrives flat or what
arrives steeply would be noisy."""


def on_surface(scene: Scene, position, normal, reach, number: int):
    """Points and normals moved from an even mesh to the surface that it stands for, mi.Point3f and mi.Vector3f.

    normal: of the side that is meant. reach: metres, mi.Float, that the surface may be away; a point from which none is
    found along its normal stays. number: of points.
    """
    assert dr.width(position) == number  # by which recordings are told apart
    position, normal = mi.Point3f(position), mi.Vector3f(normal)
    back = mi.math.RayEpsilon * (1 + dr.max(dr.abs(position)))  # so that the surface at a point itself is met
    found, length = dr.zeros(mi.SurfaceInteraction3f, number), mi.Float(dr.inf)
    for way in (normal, -normal):
        ray = mi.Ray3f(position - back * way, way, reach + back, 0.0, [])
        hit = scene.mi_scene.ray_intersect(ray, mi.RayFlags.Minimal, False)
        away = dr.abs(hit.t - back)
        closer = hit.is_valid() & (away < length)
        found = dr.select(closer, hit, found)
        length = dr.select(closer, away, length)
    moved = dr.isfinite(length)
    place = dr.select(moved, found.p, position)
    facing = dr.select(moved, dr.mulsign(mi.Vector3f(found.n), dr.dot(found.n, normal)), normal)
    dr.eval(place, facing)
    return place, facing


@dr.syntax
def _out(scene, sampler, ray, max_depth):
    """Follows paths along `ray` until they leave. Their start is the first scattering event.

    Returns whether they left after another one, or straight; the last direction; the throughput; whether the first hit
    was the back of a mesh, or near.
    """
    context = mi.BSDFContext()
    ray = mi.Ray3f(ray)
    throughput, towards = mi.Spectrum(1), mi.Vector3f(0)
    eta, depth = mi.Float(1), mi.UInt32(1)
    left, straight, back, near = mi.Bool(False), mi.Bool(False), mi.Bool(False), mi.Bool(False)
    active = mi.Bool(True)
    while active:
        si = scene.ray_intersect(ray, mi.RayFlags.All, False, active)
        hit = si.is_valid()
        first = depth == 1
        back |= first & hit & si.shape.is_mesh() & (dr.dot(si.n, ray.d) > 0)
        near |= first & hit & (si.t < NEAR)
        straight |= first & ~hit
        left |= ~first & ~hit
        towards = dr.select(hit, towards, ray.d)
        active &= hit & (depth < max_depth)
        bsdf = si.bsdf(ray)
        bounce, weight = bsdf.sample(context, si, sampler.next_1d(), sampler.next_2d(), active)
        throughput *= dr.select(active, weight, 1)
        eta *= dr.select(active, bounce.eta, 1)
        depth += 1
        ray = si.spawn_ray(si.to_world(bounce.wo))
        survival = dr.minimum(dr.max(throughput) * dr.square(eta), RR_CAP)
        active &= survival > 0
        roulette = active & (depth >= RR_DEPTH)
        active &= ~roulette | (sampler.next_1d() < survival)
        throughput *= dr.select(roulette, inverse(survival), 1)
    return left, straight, towards, throughput, back, near


def paths_out(
    scene: Scene,
    position: Any,
    normal: Any,
    seed: Any,
    max_depth: Any,
    vertices: int,
    points: int,
    samples: int,
    levels: int,
) -> dict[str, Any]:
    """Paths from the points of vertices, a lane each: `samples` a vertex, dealt out in turn to its `points`.

    position, normal: mi.Point3f, mi.Vector3f, on surfaces, by vertex and then point. max_depth: mi.UInt32, scattering
    events, that at the start included. vertices: how many. points: at each, a power of two. samples: paths of each,
    4^levels. Returns `arriving`, the direction that light comes along at the start; `towards`, where it is from;
    `throughput`, over the density of `arriving`, 0 of paths that did not leave or left straight; `left`, whether a path
    left, `back` and `near`, whether its first hit was the back of a mesh, or near, 0 or 1.
    """
    lanes = vertices * samples
    sampler = StratifiedSampler(seed, lanes, levels)
    lane = dr.arange(mi.UInt32, lanes)
    # Of neighbouring lanes directions are alike, so they go to different points.
    point = lane // dr.opaque(mi.UInt32, samples) * points + (lane & (points - 1))
    start = dr.zeros(mi.Interaction3f, lanes)
    start.p = dr.gather(mi.Point3f, position, point)
    start.n = dr.gather(mi.Normal3f, mi.Normal3f(normal), point)
    u = sampler.next_2d()
    cosine = (dr.sqrt(dr.square(FLAT) + 4 * (1 - FLAT) * u.x) - FLAT) / (2 * (1 - FLAT))
    density = (FLAT + 2 * (1 - FLAT) * cosine) * dr.inv_two_pi
    sine = dr.safe_sqrt(1 - dr.square(cosine))
    around = dr.sincos(dr.two_pi * u.y)
    arriving = mi.Frame3f(start.n).to_world(mi.Vector3f(sine * around[1], sine * around[0], cosine))
    left, straight, towards, throughput, back, near = _out(
        scene.mi_scene, sampler.independent, start.spawn_ray(arriving), max_depth
    )
    throughput *= dr.rcp(density)
    sound = left & dr.all(dr.isfinite(throughput))
    number = lambda mask: dr.select(mask, mi.Float(1), mi.Float(0))  # noqa: E731
    found = {
        "arriving": arriving,
        "towards": towards,
        "throughput": dr.select(sound, throughput, 0),
        "left": number(left | straight),
        "back": number(back),
        "near": number(near),
    }
    dr.eval(found)
    return found
