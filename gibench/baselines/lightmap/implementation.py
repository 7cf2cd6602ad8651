"""The method `lightmap`: what is emitted, and what the lightmap says is reflected diffusely. Nothing glossy."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import ClassVar

import drjit as dr
import mitsuba as mi

from gibench.baselines.first_hits import averaged, hits_of_rays
from gibench.baselines.lightmap.deferred import OnLightmap
from gibench.baselines.method import Prediction, View
from gibench.baselines.stages import Stages
from gibench.rendering.replay import camera_arrays, ray_generator


def _shaded(scene, lightmap, camera, width: int, height: int):
    hits = hits_of_rays(scene, ray_generator(camera), (width, height))
    color = hits.emission + lightmap.diffuse(hits.si, hits.preliminary, hits.active)
    dr.eval(color)
    return color


class LightmapMethod(OnLightmap):
    """See `gibench.baselines.lightmap.METHOD`."""

    functions: ClassVar = {"g-buffer": _shaded}

    def render(self, view: View, stages: Stages) -> Prediction:
        """Look the lightmap up at every first hit."""
        fine = self.fine(view)
        with stages.stage("g-buffer"):
            color = averaged(
                self.kernels["g-buffer"](camera_arrays(view.camera, fine), *fine), fine, self.grid
            )
        return Prediction(color=color, specular=dr.zeros(mi.TensorXf, color.shape))
