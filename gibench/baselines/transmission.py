"""What is seen through glass and through the holes of masks: one ray, bent at each surface that lets light through."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import drjit as dr
import mitsuba as mi

from gibench.baselines.first_hits import hits_of_rays
from gibench.rendering import flags
from gibench.rendering.lobes import lobes_of
from gibench.rendering.replay import ray_generator

SURFACES = 8
"""That a ray goes through, at most: four panes of two sides each."""


def transmits(layers) -> bool:
    """Whether anything of a scene can be seen through. layers: `Scene.layers`."""
    return layers.transmits or layers.masked


def _separable(layers, bsdf, active):
    """Whether a material's own light can be told from what goes through it: not of `principled`."""
    return bsdf.has_attribute("base_color", active) ^ True if layers.principled else mi.Bool(True)


def goes_through(layers, bsdf, bounce, active):
    """Whether `seen_through` tells of a sample (mi.BSDFSample3f) of a material."""
    if not transmits(layers):
        return mi.Bool(False)
    through = mi.has_flag(bounce.sampled_type, mi.BSDFFlags.Null)
    through |= ((bounce.sampled_type & flags.TRANSMITS) != 0) & _separable(layers, bsdf, active)
    return active & through


def _passed(layers, bsdf, si, active):
    """Direction (local) of a ray behind a surface, and the share of light from there, mi.Color3f; 0 where none is.

    Of several ways, as behind a blend, the one that brings most stands for all. A rough lobe is drawn sharp.
    """
    parts, holes = layers.parts(bsdf, si, active)
    direction, best, total = -si.wi, mi.Float(holes), mi.Color3f(holes)
    for part in parts:
        on = active & (part.weight > 0) & ((part.bsdf.flags() & flags.TRANSMITS) != 0)
        on &= _separable(layers, part.bsdf, on)
        bounce, weight = part.bsdf.sample(lobes_of(flags.TRANSMITS), si, 0.5, mi.Point2f(0.5), on)
        behind = on & (bounce.wo.z * si.wi.z < 0) & (bounce.pdf > 0) & dr.all(dr.isfinite(weight))
        share = dr.select(behind, part.weight * weight, 0)
        total += share
        larger = dr.max(share) > best
        direction, best = dr.select(larger, bounce.wo, direction), dr.maximum(best, dr.max(share))
    return direction, dr.select(active, total, 0)


@dr.syntax
def seen_through(scene, layers, lightmap, si, bsdf, active):
    """Radiance that comes through surfaces towards si.wi, mi.Color3f: emission and diffuse light behind them.

    scene: mitsuba.Scene. layers: `Scene.layers`, of which something `transmits`. lightmap: `Lightmap`. bsdf: of the
    first hits si. `principled` lets nothing through here.
    """
    total = mi.Color3f(0)
    direction, throughput = _passed(layers, bsdf, si, active)
    ray = si.spawn_ray(si.to_world(direction))
    number = mi.UInt32(1)
    alive = active & (dr.max(throughput) > 0)
    while alive:
        found = scene.ray_intersect_preliminary(ray, coherent=False, active=alive)
        hit = found.compute_surface_interaction(ray, mi.RayFlags.All, alive)
        radiance = hit.emitter(scene).eval(hit, alive) + lightmap.diffuse(hit, found, alive)
        total += dr.select(alive, throughput * radiance, 0)
        alive &= hit.is_valid() & (number < SURFACES)
        direction, share = _passed(layers, hit.bsdf(ray), hit, alive)
        throughput *= share
        ray = hit.spawn_ray(hit.to_world(direction))
        number += 1
        alive &= dr.max(throughput) > 0
    return total


def seen_behind(scene, lightmap, camera, preliminary, width: int, height: int):
    """`seen_through` at the first hits of a frame, to be recorded: one kernel, where a scene `transmits`.

    scene: `Scene`. camera: from `camera_arrays`. preliminary: what its rays hit.
    """
    hits = hits_of_rays(scene, ray_generator(camera), (width, height), preliminary)
    light = seen_through(scene.mi_scene, scene.layers, lightmap, hits.si, hits.bsdf, hits.glossy)
    dr.eval(light)
    return light
