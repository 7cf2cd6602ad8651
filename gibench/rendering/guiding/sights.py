"""Looks around from surfaces all over a room: where light comes from.

Paths have told what every place sends, in the mean. A look is two rays: one finds a surface, the next what that
surface sees. That takes a fraction of the time of a path and has little of its noise, as final gathering from a coarse
solution does (Jensen 1996, from photons).
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.rendering.backend import tracing
from gibench.rendering.guiding.directions import bin_of
from gibench.rendering.guiding.grid import facing
from gibench.rendering.guiding.guide import Guide
from gibench.rendering.guiding.paths import Starts, sampler_of
from gibench.rendering.light_sampling import emission, emission_weight


@dataclass
class Sights:
    """Looks, (N,) each.

    place: number in the grid, of a diffuse surface. direction: bin of the look. density: of its direction, per
    steradian, the cosine over π. brought: radiance from there; that of lights has the weight that a bounce has beside
    the samples of lights.
    """

    place: NDArray[np.uint32]
    direction: NDArray[np.uint32]
    density: NDArray[np.float32]
    brought: NDArray[np.float64]


def look_around(
    scene: Any, guide: Guide, starts: Starts, radiance: NDArray[np.float64], looks: int
) -> Sights:
    """Look from wherever a ray from `starts` meets a diffuse surface.

    guide: of the lights. radiance: (places,) that each place sends. looks: how many rays are sent.
    """
    sent = mi.Float(np.minimum(radiance, np.finfo(np.float32).max).astype(np.float32))
    dr.make_opaque(sent)
    with tracing():
        sampler = sampler_of(looks, 0, 0)
        ray = starts.ray(sampler)
        si = scene.mi_scene.ray_intersect(ray)
        active = si.is_valid() & mi.has_flag(si.bsdf(ray).flags(), mi.BSDFFlags.DiffuseReflection)
        normal = facing(si)
        place = guide.grid.place_or_outside(si.p, normal, mi.Vector3f(0))
        row = guide.row(si, sampler.independent, active)
        local = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
        density = mi.warp.square_to_cosine_hemisphere_pdf(local)
        direction = mi.Frame3f(normal).to_world(local)
        # A mesh whose normals are zero has no sides to look from.
        active &= dr.all(dr.isfinite(direction)) & (density > 0)
        seen = scene.mi_scene.ray_intersect(si.spawn_ray(direction), mi.RayFlags.All, False, active)
        there = guide.grid.place_or_outside(seen.p, facing(seen), mi.Vector3f(0))
        brought = dr.gather(mi.Float, sent, there, active & seen.is_valid())
        weight = emission_weight(
            scene.mi_scene,
            guide.portals,
            guide,
            seen,
            mi.Interaction3f(si),
            row,
            density,
            mi.Bool(False),
            active,
        )
        brought += dr.select(active, dr.mean(emission(scene.mi_scene, seen, active)) * weight, 0)
        toward = bin_of(direction)
        dr.eval(place, toward, density, brought, active)
    tells = np.array(active) & np.isfinite(np.array(brought))
    place, toward, density, brought = (np.array(a)[tells] for a in (place, toward, density, brought))
    return Sights(place, toward, density, brought.astype(np.float64))
