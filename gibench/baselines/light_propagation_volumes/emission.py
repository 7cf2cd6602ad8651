"""Virtual lights: what the first surfaces on paths from the area light reflect, put into a volume.

The paper takes them from a shadow map with reflected flux. A rectangle that shines over half of all directions has no
single such map, so they are hits of emitted paths here. The paths begin on one lattice in every frame: as evenly as so
many can, and alike from frame to frame, so that a still light does not flicker.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.baselines.light_propagation_volumes.volume import as_intensity, emptied, injected
from gibench.rendering import surface
from gibench.rendering.scene import Scene

GENERATOR = 1.1673039782614187
"""Positive root of x⁵ = x + 1: multiples of its powers −1 to −4 are spread evenly in four dimensions (Roberts 2018)."""

OFF = 1e-4
"""Of the size of the coordinates: how far before the rectangle its paths begin, so that they do not hit it."""


def lattice(count: int) -> list[Any]:
    """Four mi.Float in [0, 1) of `count` lanes. In whole numbers, since float32 has no digits left for products."""
    lane = dr.arange(mi.UInt32, count)
    steps = (int(GENERATOR**-power * 2**32) for power in range(1, 5))
    return [mi.Float((lane * step + (1 << 31)) >> 8) * 2.0**-24 for step in steps]


def emitted(light: dict[str, Any], count: int) -> Any:
    """Rays that leave the bright side of a rectangle, mi.Ray3f: uniform over it, by the cosine over directions.

    light: `rectangle.light_arrays`.
    """
    u = lattice(count)
    local = mi.warp.square_to_cosine_hemisphere(mi.Point2f(u[2], u[3]))
    direction = local.x * light["across"] + local.y * light["up"] + local.z * light["forward"]
    across, up = (u[0] - 0.5) * light["width"], (u[1] - 0.5) * light["height"]
    point = light["centre"] + across * light["across"] + up * light["up"]
    point = point + OFF * (1 + dr.max(dr.abs(point))) * light["forward"]
    return mi.Ray3f(mi.Point3f(point), mi.Vector3f(direction))


def lit_volume(
    scene: Scene, grid: dict[str, Any], light: dict[str, Any], count: int, bounces: int, cells: int
) -> list[Any]:
    """Intensity of the cells of a volume, per light that is emitted, from `count` paths. See `volume.injected`."""
    ray, throughput = emitted(light, count), mi.Color3f(dr.opaque(mi.Float, 1 / count, count))
    sums = emptied(cells)
    lane = dr.arange(mi.UInt32, count)
    for bounce in range(bounces):
        # Each bounce launches the same kernel again.
        number = dr.opaque(mi.UInt32, bounce)
        dr.eval(ray, throughput, sums)
        si = scene.mi_scene.ray_intersect(ray)
        bsdf, active = si.bsdf(), si.is_valid() & (dr.max(throughput) > 0)
        active &= (si.wi.z > 0) | mi.has_flag(bsdf.flags(), mi.BSDFFlags.BackSide)
        normal = mi.Vector3f(dr.mulsign(si.sh_frame.n, si.wi.z))
        reflected = throughput * surface.albedo(scene, bsdf, si, active)
        injected(grid, sums, si.p, normal, reflected, active)
        u = [mi.sample_tea_float32(lane, 3 * number + k) for k in range(3)]
        turn, weight = bsdf.sample(mi.BSDFContext(), si, u[0], mi.Point2f(u[1], u[2]), active)
        ray = si.spawn_ray(si.to_world(turn.wo))
        throughput = dr.select(active & (turn.pdf > 0), throughput * weight, 0)
    state = as_intensity(sums)
    dr.eval(state)
    return state
