"""The method `rtrt`: diffuse light from the lightmap, glossy light from a few paths a pixel, denoised."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import ClassVar

import drjit as dr
import mitsuba as mi

from gibench.baselines.first_hits import averaged, hits_of_rays
from gibench.baselines.lightmap.deferred import OnLightmap
from gibench.baselines.method import Prediction, View
from gibench.baselines.replay import camera_arrays, ray_generator
from gibench.baselines.rtrt.glossy_paths import glossy_radiance
from gibench.baselines.stages import Stages
from gibench.rendering import surface
from gibench.rendering.denoise import denoise


def _gbuffer(scene, lightmap, camera, width: int, height: int, denoised: bool):
    """What was hit, what it sends out but for glossy light, and what guides the denoiser."""
    hits = hits_of_rays(scene, ray_generator(camera), (width, height))
    seen = hits.emission + lightmap.diffuse(hits.si, hits.preliminary, hits.active)
    guides = {}
    if denoised:
        # The albedo of the layer that is denoised: the texture of a coated wood is not in its reflections.
        tint = surface.specular_albedo(scene, hits.bsdf, hits.si, hits.active)
        normal = dr.select(hits.active, dr.mulsign(hits.si.sh_frame.n, hits.si.wi.z), 0)
        guides = {"albedo": mi.Color3f(dr.clip(tint, 0, 1)), "normal": mi.Color3f(normal)}
    dr.eval(hits.preliminary, seen, guides)
    return hits.preliminary, seen, guides


def _traced(scene, lightmap, camera, preliminary, seed, samples, bounces, width: int, height: int):
    hits = hits_of_rays(scene, ray_generator(camera), (width, height), preliminary)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, width * height)
    radiance = glossy_radiance(
        scene.mi_scene, lightmap, sampler, hits.si, hits.bsdf, hits.active, samples, bounces
    )
    dr.eval(radiance)
    return radiance


class GlossyRays(OnLightmap):
    """See `gibench.baselines.rtrt.METHOD`."""

    functions: ClassVar = {"g-buffer": _gbuffer, "paths": _traced}

    def render(self, view: View, stages: Stages) -> Prediction:
        """Trace the glossy paths of a frame in one kernel and denoise their image."""
        grid, fine, denoised = self.grid, self.fine(view), bool(self.settings["denoise"])
        camera = camera_arrays(view.camera, fine)
        with stages.stage("g-buffer"):
            preliminary, seen, guides = self.kernels["g-buffer"](camera, *fine, denoised)
            base = averaged(seen, fine, grid)
            images = {name: averaged(values, fine, grid) for name, values in guides.items()}
        with stages.stage("ray casting"):
            numbers = (view.seed % 2**32, int(self.settings["samples"]), int(self.settings["bounces"]))
            opaque = [dr.opaque(mi.UInt32, number) for number in numbers]
            specular = averaged(self.kernels["paths"](camera, preliminary, *opaque, *fine), fine, grid)
        if denoised:
            with stages.stage("denoising"):
                specular = denoise(specular, **images)
        return Prediction(color=base + specular, specular=specular)
