"""Share of the light samples that pays to be sent through the windows of a scene: learned from its own light.

Portals find the sky, which most other samples lose on the walls; but the sun, which the environment's own distribution
finds best, and the lamps have fewer samples then. Which of them make the noise depends on the room. So a few rays go in
by the windows and on through the room, and at each point that they meet one light sample and one bounce are taken. Each
was drawn with a known density, so that its second moment is known for every other density too (importance sampling,
Veach 1997, section 2.5.2): for every share of the portals. The share of the least moment is chosen.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.rendering.backend import tracing
from gibench.rendering.guiding.grid import Grid
from gibench.rendering.light_sampling import sample_light

SHARES = (0.0, 0.125, 0.25, 0.375, 0.5)
"""That are compared."""

COST = 1.12
"""CPU time of a path with portals over that without, geometric mean of eight rooms."""

LANES = 1 << 16

BOUNCES = 3
"""Points that a ray from a window visits."""

CELLS = 1000
"""Places over which the mean light is taken, to which its noise is relative."""

DARK = 0.3
"""Share of the mean light of all places, squared, that is added to that of one: bright places make the noise of
all that they light. With it the rooms by day are in the order of their measured gain."""


def portal_share(mi_scene: Any, portals: Any) -> float:
    """One of SHARES. portals: `Portals` with a rectangle at least and an environment."""
    with tracing():
        found = _points(mi_scene, portals)
    noise = relative_noise(*found)
    noise[1:] *= COST
    return SHARES[int(noise.argmin())]


def _points(mi_scene, portals):
    """Place (N,) of each point, and of its light sample and its bounce: see `relative_noise`."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(dr.opaque(mi.UInt32, 0), LANES)
    inward, start = portals.entrance(mi.Point2f(sampler.next_2d()))
    direction = mi.Frame3f(inward).to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d()))
    ray = mi.Ray3f(start, direction)
    alive = mi.Bool(True)
    hits, lights, bounces = [], [], []
    for _ in range(BOUNCES):
        dr.make_opaque(ray.o, ray.d, alive)
        si = mi_scene.ray_intersect(ray, mi.RayFlags.All, False, alive)
        alive = alive & si.is_valid() & (si.emitter(mi_scene) == dr.zeros(mi.EmitterPtr))
        normal = dr.mulsign(si.n, -dr.dot(si.n, ray.d))
        frame = mi.Frame3f(normal)
        si.sh_frame = frame
        si.wi = si.to_local(-ray.d)
        light = sample_light(mi_scene, portals, None, si, mi.UInt32(0), sampler, alive)
        cosine = dr.maximum(dr.dot(light.direction, normal), 0)
        outside = alive & (light.pdf > 0) & (light.emitter == portals.environment)
        by_portal = dr.select(outside, portals.density(si.p, light.direction), 0)
        _, towards = portals.environment_from(light.direction, outside)
        rest = light.pdf / (1 - portals.fraction)
        rest = dr.select(outside, mi_scene.pdf_emitter_direction(si, towards, outside), rest)
        radiance = dr.mean(light.weight) * light.pdf * cosine * dr.inv_pi
        lit = [radiance, rest, by_portal, dr.select(light.delta, 0, cosine * dr.inv_pi), light.pdf]

        local = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
        onward = si.spawn_ray(frame.to_world(local))
        pdf = local.z * dr.inv_pi
        met = mi_scene.ray_intersect(onward, mi.RayFlags.All, False, alive)
        emitter = met.emitter(mi_scene)
        towards = mi.DirectionSample3f(mi_scene, met, si)
        shines = alive & (emitter != dr.zeros(mi.EmitterPtr))
        through = dr.select(emitter == portals.environment, portals.density(si.p, onward.d), 0)
        rest = mi_scene.pdf_emitter_direction(si, towards, shines)
        seen = [dr.mean(emitter.eval(met, shines)) * pdf, rest, through, pdf, pdf]
        dr.eval(si.p, normal, alive, lit, seen, onward)
        hits.append((np.array(si.p).T, np.array(normal).T, np.array(alive)))
        lights.append(np.array([np.array(x) for x in lit], dtype=np.float64))
        bounces.append(np.array([np.array(x) for x in seen], dtype=np.float64))
        ray = mi.Ray3f(onward)
    position, normal, alive = (np.concatenate(column) for column in zip(*hits, strict=True))
    place = _places(position[alive], normal[alive])
    return place, np.concatenate(lights, axis=1)[:, alive], np.concatenate(bounces, axis=1)[:, alive]


def _places(position: NDArray[Any], normal: NDArray[Any]) -> NDArray[np.int64]:
    """Number of the place of each point, of a grid over nearly all of them."""
    if not len(position) or not np.ptp(low_high := np.quantile(position, (0.02, 0.98), axis=0), axis=0).any():
        return np.zeros(len(position), dtype=np.int64)
    grid = Grid(*low_high, cells=CELLS)
    place, _ = grid.place(mi.Point3f(position.T), mi.Vector3f(normal.T), mi.Vector3f(0))
    return np.array(place).astype(np.int64)


def relative_noise(
    place: NDArray[np.int64], lights: NDArray[np.float64], bounces: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Second moment of direct light over its squared mean, averaged over points, for each of SHARES.

    place: (N,) number of the place of a point. lights, bounces: (5, N) of its light sample and its bounce: reflected
    radiance, density without portals, density by portals alone, density of the bounce, density of the sample as it was
    drawn, per steradian.
    """
    if not len(place):
        return np.ones(len(SHARES))
    count = np.bincount(place)
    mean = np.zeros(len(place))
    moments = np.zeros((len(SHARES), len(place)))
    for is_bounce, (radiance, rest, by_portal, by_bounce, drawn) in enumerate((lights, bounces)):
        found = (drawn > 0) & np.isfinite(radiance) & np.isfinite(rest) & np.isfinite(by_portal)
        radiance, drawn = np.where(found, radiance, 0), np.where(found, drawn, 1)
        for k, share in enumerate(SHARES):
            light = np.where(found, (1 - share) * rest + share * by_portal, 1)
            own, other = (by_bounce, light) if is_bounce else (light, by_bounce)
            with np.errstate(divide="ignore", invalid="ignore"):
                weight = np.where(own > 0, 1 / (1 + np.square(other / own)), 0)
                value = np.where(own > 0, radiance * weight / own, 0)
            # Drawn by one density, judged by another.
            moments[k] += np.square(value) * own / drawn
            if k == len(SHARES) - 1:
                mean += value * own / drawn
    mean = np.bincount(place, mean) / np.maximum(count, 1)
    scale = np.square(mean) + DARK * (mean * count).sum() ** 2 / count.sum() ** 2
    if not (scale[place] > 0).all():
        return np.ones(len(SHARES))
    return np.asarray((moments / scale[place]).mean(axis=1))
