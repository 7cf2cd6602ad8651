"""Radiance cues: direct light on a frame's surfaces as if they were made of one of four basis materials.

Gao et al. 2022 ("Neural Global Illumination: Interactive Indirect Illumination Prediction under Dynamic Area Lights"),
section 3.2.1: every material that is not diffuse is replaced by a Lambertian one, or by a Cook-Torrance one of
roughness 0.05, 0.13 or 0.34; here the roughness is GGX alpha, and all four reflect all light (their reflectance is
unpublished). What is diffuse keeps its own material. All four share the first hit and every shadow ray: a light sample,
and one direction that is drawn from the mean of the four lobes.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.rendering import flags
from gibench.rendering.channels import CUES
from gibench.rendering.integrator import bsdf_at, shading_normal
from gibench.rendering.light_sampling import emission, emission_weight, inverse, mis_weight, sample_light
from gibench.rendering.replay import ray_generator
from gibench.rendering.sampling import IndependentSampler
from gibench.rendering.scene import Scene

ALPHAS = (0.05, 0.13, 0.34)
"""GGX roughness of the bases after the Lambertian one."""

GUIDES = ("albedo", "normal")
"""Guides of a denoiser beside the cues; the albedo is that of the materials that stand in."""


class _Bases:
    """The four lobes at hits, seen from the front. wi: local, its z ≥ 0."""

    def __init__(self, wi: Any) -> None:
        self.wi = wi
        self.lobes = [mi.MicrofacetDistribution(mi.MicrofacetType.GGX, mi.Float(alpha)) for alpha in ALPHAS]

    def values(self, wo: Any) -> list[Any]:
        """BSDF times cosine, mi.Float each; 0 below the surface."""
        above = (wo.z > 0) & (self.wi.z > 0)
        half = dr.normalize(self.wi + wo)
        values = [wo.z * dr.inv_pi]
        for lobe in self.lobes:
            values.append(lobe.eval(half) * lobe.G(self.wi, wo, half) * 0.25 * inverse(self.wi.z))
        return [dr.select(above, value, 0) for value in values]

    def density(self, wo: Any) -> Any:
        """Of `sample`, per steradian."""
        above = (wo.z > 0) & (self.wi.z > 0)
        half = dr.normalize(self.wi + wo)
        total = wo.z * dr.inv_pi
        for lobe in self.lobes:
            total += lobe.pdf(self.wi, half) * 0.25 * inverse(dr.dot(wo, half))
        return dr.select(above, total / (1 + len(self.lobes)), 0)

    def sample(self, choice: Any, u: Any) -> Any:
        """Directions from one of the lobes each. choice: mi.Float in [0, 1)."""
        which = mi.UInt32(choice * (1 + len(self.lobes)))
        wo = mi.warp.square_to_cosine_hemisphere(u)
        for number, lobe in enumerate(self.lobes, 1):
            normal, _ = lobe.sample(self.wi, u)
            wo = dr.select(which == number, mi.reflect(self.wi, normal), wo)
        return wo


def light_cues(scene: Scene, sampler: Any, rays: Any) -> dict[str, Any]:
    """One sample a ray of each of `CUES` and of GUIDES, mi.Color3f or mi.Vector3f; 0 where nothing is hit.

    sampler: from `sampling`. rays: mi.Ray3f. Needs a vectorised variant; for a `Replay` see `cue_images`.
    """
    mi_scene, portals = scene.mi_scene, scene.portals
    si = mi_scene.ray_intersect(rays, mi.RayFlags.All, True)
    active = si.is_valid()
    bsdf = bsdf_at(si, rays)
    own = active & ((bsdf.flags() & flags.NOT_DIFFUSE) == 0)
    side = dr.mulsign(mi.Float(1), si.wi.z)
    front = mi.Vector3f(si.wi.x, si.wi.y, dr.abs(si.wi.z))
    bases, context = _Bases(front), mi.BSDFContext()

    def values(towards: Any, active: Any) -> list[Any]:
        """BSDF values of the four for a local direction, mi.Color3f."""
        kept = bsdf.eval(context, si, towards, active & own)
        others = bases.values(mi.Vector3f(towards.x, towards.y, towards.z * side))
        return [dr.select(own, kept, mi.Color3f(value)) for value in others]

    def density(towards: Any) -> Any:
        turned = mi.Vector3f(towards.x, towards.y, towards.z * side)
        return dr.select(own, dr.maximum(turned.z, 0) * dr.inv_pi, bases.density(turned))

    # A guide learns where light comes from for the scene's own materials; these are others.
    light = sample_light(mi_scene, portals, None, si, mi.UInt32(0), sampler, active)
    to_light = si.to_local(light.direction)
    mis = dr.select(light.delta, 1, mis_weight(light.pdf, density(to_light)))
    lit = active & (light.pdf != 0)
    sums = [dr.select(lit, value * light.weight * mis, 0) for value in values(to_light, lit)]

    choice, u = sampler.next_1d(), sampler.next_2d()
    bounce = dr.select(own, mi.warp.square_to_cosine_hemisphere(u), bases.sample(choice, u))
    bounce.z *= side
    pdf = density(bounce)
    onward = active & (pdf > 0)
    met = mi_scene.ray_intersect(si.spawn_ray(si.to_world(bounce)), mi.RayFlags.All, False, onward)
    reference, row = mi.Interaction3f(si), mi.UInt32(0)
    weight = emission_weight(mi_scene, portals, None, met, reference, row, pdf, mi.Bool(False), onward)
    emitted = emission(mi_scene, met, onward) * weight * inverse(pdf)
    for number, value in enumerate(values(bounce, onward)):
        sums[number] += dr.select(onward, value * emitted, 0)

    found: dict[str, Any] = dict(zip(CUES, sums, strict=True))
    albedo = dr.clip(bsdf.eval_diffuse_reflectance(si, own), 0, 1)
    found["albedo"] = dr.select(active, dr.select(own, albedo, 1), 0)
    found["normal"] = dr.select(active, dr.mulsign(shading_normal(si), dr.dot(si.n, -rays.d)), 0)
    return found


def cue_images(
    scene: Scene, camera: dict[str, Any], seed: Any, first: Any, width: Any, pixels: int, spp: int
) -> dict[str, Any]:
    """Means over `spp` samples a pixel of all that `light_cues` gives, in row order, on the device.

    A function for a `Replay` (after the scene): camera as `replay.camera_arrays`; seed, first (pixel) and width (of the
    frame) are mi.UInt32; pixels and spp are whole numbers.
    """
    sampler = IndependentSampler()
    sampler.independent.seed(seed, pixels * spp)
    pixel = dr.arange(mi.UInt32, pixels * spp) // dr.opaque(mi.UInt32, spp) + first
    row = pixel // width
    corner = mi.Point2f(mi.Float(pixel - row * width), mi.Float(row))
    values = light_cues(scene, sampler, ray_generator(camera).rays(corner + sampler.next_2d()))
    # A sample that overflows counts as black. Shares are summed, so that huge radiance does not overflow on the way.
    finite = dr.all(dr.isfinite(sum(values[name] for name in CUES)))
    per_sample = dr.rcp(dr.opaque(mi.Float, spp))
    values = {name: dr.select(finite, value * per_sample, 0) for name, value in values.items()}
    # One kernel for all of it. A reduction of what is not evaluated yet would trace the samples once more.
    dr.eval(values)
    sums = {name: type(value)(*(dr.block_sum(c, spp) for c in value)) for name, value in values.items()}
    dr.eval(sums)
    return sums
