"""Base of the methods whose glossy light is traced from the first hits, over a lightmap, and denoised."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi
import numpy as np

from gibench.baselines.first_hits import averaged, hits_of_rays
from gibench.baselines.lightmap.deferred import OnLightmap
from gibench.baselines.method import Prediction, View
from gibench.baselines.stages import Stages
from gibench.rendering import surface
from gibench.rendering.denoise import denoise
from gibench.rendering.replay import camera_arrays, ray_generator


def _gbuffer(scene, lightmap, camera, width: int, height: int, denoised: bool):
    """First hits, their radiance but for glossy light, and the guides of the denoiser."""
    hits = hits_of_rays(scene, ray_generator(camera), (width, height))
    base = hits.emission + lightmap.diffuse(hits.si, hits.preliminary, hits.active)
    guides = {}
    if denoised:
        # The albedo of the layer that is denoised: the texture of a coated wood is not in its reflections.
        tint = surface.specular_albedo(scene, hits.bsdf, hits.si, hits.active)
        guides = {"albedo": mi.Color3f(dr.clip(tint, 0, 1)), "normal": mi.Color3f(hits.normal)}
    dr.eval(hits.preliminary, base, guides)
    return hits.preliminary, base, guides


class GlossyLayer(OnLightmap):
    """A method with the setting "denoise". A subclass gives `glossy`, and names the stage that it is."""

    functions: ClassVar = {"g-buffer": _gbuffer}
    stage: ClassVar[str]

    def glossy(self, view: View, camera: dict[str, Any], preliminary: Any) -> tuple[Any, dict[str, float]]:
        """Glossy light at each camera ray, mi.Color3f, and numbers worth a column.

        camera: from `camera_arrays`, of the finer grid. preliminary: what its rays hit.
        """
        raise NotImplementedError

    def render(self, view: View, stages: Stages) -> Prediction:
        """First hits and their diffuse light, the glossy light, and its denoised image."""
        grid, fine, denoised = self.grid, self.fine(view), bool(self.settings["denoise"])
        camera = camera_arrays(view.camera, fine)
        with stages.stage("g-buffer"):
            preliminary, base, guides = self.kernels["g-buffer"](camera, *fine, denoised)
            base = averaged(base, fine, grid)
            images = {name: np.asarray(averaged(values, fine, grid)) for name, values in guides.items()}
        with stages.stage(self.stage):
            color, extra = self.glossy(view, camera, preliminary)
            specular = averaged(color, fine, grid)
        if denoised:
            with stages.stage("denoising"):
                specular = mi.TensorXf(denoise(np.asarray(specular), **images))
        return Prediction(color=base + specular, specular=specular, extra=extra)
