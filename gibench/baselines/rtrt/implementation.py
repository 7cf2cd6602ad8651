"""The method `rtrt`: diffuse light from the lightmap, glossy light from a few paths a pixel, denoised."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi

from gibench.baselines.first_hits import hits_of_rays
from gibench.baselines.lightmap.glossy_layer import GlossyLayer
from gibench.baselines.method import View
from gibench.baselines.rtrt.glossy_paths import glossy_radiance
from gibench.rendering.replay import ray_generator


def _traced(scene, lightmap, camera, preliminary, seed, samples, bounces, width: int, height: int):
    hits = hits_of_rays(scene, ray_generator(camera), (width, height), preliminary)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, width * height)
    radiance = glossy_radiance(
        scene.mi_scene,
        scene.portals,
        scene.layers,
        lightmap,
        sampler,
        hits.si,
        hits.bsdf,
        hits.active,
        samples,
        bounces,
    )
    dr.eval(radiance)
    return radiance


class GlossyRays(GlossyLayer):
    """See `gibench.baselines.rtrt.METHOD`."""

    functions: ClassVar = {**GlossyLayer.functions, "paths": _traced}
    stage = "ray casting"

    def glossy(self, view: View, camera: dict[str, Any], preliminary: Any) -> tuple[Any, dict[str, float]]:
        """Trace the glossy paths of a frame in one kernel."""
        numbers = (view.seed % 2**32, int(self.settings["samples"]), int(self.settings["bounces"]))
        opaque = [dr.opaque(mi.UInt32, number) for number in numbers]
        return self.kernels["paths"](camera, preliminary, *opaque, *self.fine(view)), {}
