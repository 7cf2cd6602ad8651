"""The method `lightmap`: what is emitted, and what the lightmap says is reflected diffusely. Nothing glossy."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import math
from collections.abc import Mapping

import drjit as dr
import numpy as np

from gibench.baselines.first_hits import averaged, hits_of_rays
from gibench.baselines.lightmap.bake import baked_lightmap
from gibench.baselines.method import Prediction, Setting, Site, View
from gibench.baselines.replay import Replay, arrays_of, camera_arrays, ray_generator
from gibench.baselines.stages import Stages


class LightmapMethod:
    """See `gibench.baselines.lightmap.METHOD`."""

    def __init__(self, settings: Mapping[str, Setting]) -> None:
        """settings: all knobs of the method."""
        self.adjust(settings)

    def adjust(self, settings: Mapping[str, Setting]) -> None:
        """Take other settings that do not bake."""
        self._settings = dict(settings)
        self._grid = math.isqrt(int(settings["rays"]))

    def prepare(self, site: Site) -> None:
        """Bake the lightmap or find it."""
        self._scene = site.scene
        self._lightmap = baked_lightmap(site, self._settings)
        self._kernel = Replay(site.scene, self._shaded, arrays_of(self._lightmap))

    def render(self, view: View, stages: Stages) -> Prediction:
        """Look the lightmap up at every first hit."""
        fine = (view.resolution[0] * self._grid, view.resolution[1] * self._grid)
        with stages.stage("g-buffer"):
            color = averaged(self._kernel(camera_arrays(view.camera, fine), *fine), fine, self._grid)
        return Prediction(color=color, specular=np.zeros_like(color))

    def _shaded(self, camera, width: int, height: int):
        hits = hits_of_rays(self._scene, ray_generator(camera), (width, height))
        color = hits.emission + self._lightmap.diffuse(hits.si, hits.preliminary, hits.active)
        dr.eval(color)
        return color
