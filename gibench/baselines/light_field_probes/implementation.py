"""The method `light-field-probes`: diffuse light from the lightmap, glossy rays that are marched through probes."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from functools import partial
from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi

from gibench.baselines.first_hits import hits_of_rays
from gibench.baselines.light_field_probes.marching import COARSE, HIT, MISS, UNKNOWN, LightField
from gibench.baselines.lightmap.glossy_layer import GlossyLayer
from gibench.baselines.method import Site, View
from gibench.baselines.probes.baking import ProbeSettings
from gibench.baselines.probes.maps import load_probes
from gibench.baselines.transmission import goes_through, seen_behind, transmits
from gibench.rendering import flags
from gibench.rendering.lobes import sample_specular
from gibench.rendering.replay import Replay, ray_generator

MAPS = ("light", "distance", "normal")


def environment(scene, direction, active) -> Any:
    """Radiance that comes from outside along rays that hit nothing (mi.Vector3f), mi.Color3f."""
    emitter = scene.environment()
    if emitter is None:
        return mi.Color3f(0)
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(direction))
    si.wi = -direction
    return emitter.eval(si, active)


def light_along(scene, field: LightField, point, direction, metre, active) -> tuple[Any, Any, Any]:
    """Radiance of rays (mi.Color3f), their fate, and the number of texels looked at on the way.

    Where no probe knows, the light is that of the nearest in the ray's direction, as if it came from far away.
    """
    probes = field.probes
    outcome, probe, way, looked = field.trace(point, direction, metre, active)
    towards = dr.select(outcome == HIT, point + way * direction - probes.position(probe), direction)
    found = mi.Color3f(probes.bilinear("light", probe, towards, active & (outcome != MISS)))
    outside = active & (outcome == MISS)
    return dr.select(outside, environment(scene, direction, outside), found), outcome, looked


@dr.syntax
def glossy_light(scene, layers, field: LightField, sampler, si, bsdf, active, samples, metre):
    """Radiance that glossy lobes reflect towards si.wi, mi.Color3f: mean of `samples` rays through the probes.

    scene: mitsuba.Scene. layers: `Scene.layers`. sampler: mi.Sampler with a lane a hit. samples: mi.UInt32, opaque.
    Exactly 0 where there is no such lobe. Returns besides, of each hit: rays that no probe could follow, texels that
    were looked at, and rays.
    """
    glossy = active & ((bsdf.flags() & flags.NOT_DIFFUSE) != 0)
    total = mi.Color3f(0)
    lost, looked, traced = mi.UInt32(0), mi.UInt32(0), mi.UInt32(0)
    done = mi.UInt32(0)
    while glossy & (done < samples):
        bounce, weight = sample_specular(layers, bsdf, si, sampler.next_1d(), sampler.next_2d(), glossy)
        direction = si.to_world(bounce.wo)
        # What goes through is looked for by another ray: probes stand in front of it.
        alive = glossy & (dr.max(weight) > 0) & (goes_through(layers, bsdf, bounce, glossy) ^ True)
        light, outcome, effort = light_along(scene, field, si.p, direction, metre, alive)
        value = weight * light
        total += dr.select(alive & dr.all(dr.isfinite(value)), value, 0)
        lost += dr.select(alive & (outcome == UNKNOWN), mi.UInt32(1), mi.UInt32(0))
        looked += dr.select(alive, effort, 0)
        traced += dr.select(alive, mi.UInt32(1), mi.UInt32(0))
        done += 1
    return total / mi.Float(dr.maximum(samples, 1)), lost, looked, traced


def _marched(scene, field: LightField, camera, preliminary, seed, samples, metre, width: int, height: int):
    hits = hits_of_rays(scene, ray_generator(camera), (width, height), preliminary)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, width * height)
    found = glossy_light(
        scene.mi_scene, scene.layers, field, sampler, hits.si, hits.bsdf, hits.active, samples, metre
    )
    dr.eval(found)
    return found


class LightFieldProbes(GlossyLayer):
    """See `gibench.baselines.light_field_probes.METHOD`."""

    functions: ClassVar = {**GlossyLayer.functions, "behind": seen_behind}
    stage = "search"

    def prepare(self, site: Site) -> None:
        """Bake the lightmap and the probes, or find them."""
        super().prepare(site)
        self._transmits = transmits(site.scene.layers)
        settings = ProbeSettings.of(self.settings).octahedral(COARSE)
        field = LightField(load_probes(site, settings, MAPS))
        self.kernels["march"] = Replay(site.scene, partial(_marched, site.scene, field), field.arrays)

    def glossy(self, view: View, camera: dict[str, Any], preliminary: Any) -> tuple[Any, dict[str, float]]:
        """March the glossy rays of a frame in one kernel; look through what can be looked through in another."""
        numbers = (view.seed % 2**32, int(self.settings["glossy_rays"]))
        metre = dr.opaque(mi.Float, float(self.settings["metre"]))
        opaque = [dr.opaque(mi.UInt32, number) for number in numbers]
        color, *effort = self.kernels["march"](camera, preliminary, *opaque, metre, *self.fine(view))
        if self._transmits:
            color += self.kernels["behind"](camera, preliminary, *self.fine(view))
        return color, _shares(*effort)


def _shares(lost: Any, looked: Any, traced: Any) -> dict[str, float]:
    """Of the rays of a frame: texels that one looked at, in the mean, and the share that no probe could follow."""
    count = max(float(dr.sum(mi.Float(traced))[0]), 1.0)
    return {
        "texels_per_ray": float(dr.sum(mi.Float(looked))[0]) / count,
        "unknown_rays": float(dr.sum(mi.Float(lost))[0]) / count,
    }
