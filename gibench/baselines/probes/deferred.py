"""Base of the methods that look glossy light up in probes: first hits, the lightmap, and the sum."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi

from gibench.baselines.first_hits import averaged, hits_of_rays
from gibench.baselines.lightmap.deferred import OnLightmap
from gibench.baselines.lightmap.lookup import Lightmap
from gibench.baselines.method import Prediction, Setting, Site, View
from gibench.baselines.probes.baking import ProbeSettings
from gibench.baselines.probes.maps import Probes, load_probes
from gibench.baselines.stages import Stages
from gibench.rendering.replay import Replay, camera_arrays, ray_generator
from gibench.rendering.scene import Scene


def surfaces_seen(scene: Scene, lightmap: Lightmap, camera, width: int, height: int) -> tuple[Any, Any, Any]:
    """First hits of a grid: where they are, whether they are glossy, and the light that is emitted or diffuse.

    camera: from `camera_arrays`. Returns mi.Point3f, mi.Bool and mi.Color3f.
    """
    hits = hits_of_rays(scene, ray_generator(camera), (width, height))
    matte = hits.emission + lightmap.diffuse(hits.si, hits.preliminary, hits.active)
    found = hits.si.p, hits.glossy, mi.Color3f(matte)
    dr.eval(found)
    return found


class ProbeLookup(OnLightmap):
    """A method whose glossy light is a function of the point that is seen, the camera's position and the probes.

    A subclass names the maps it reads and gives `glossy`.
    """

    functions: ClassVar = {"g-buffer": surfaces_seen}
    maps: tuple[str, ...] = ("radiance",)

    @staticmethod
    def glossy(probes: Probes, point: Any, camera: Any, active: Any, settings: Mapping[str, Setting]) -> Any:
        """Glossy radiance, mi.Color3f, that leaves points (mi.Point3f) for the camera (mi.Point3f of one lane)."""
        raise NotImplementedError

    def prepare(self, site: Site) -> None:
        """Bake the lightmap and the probes, or find them."""
        super().prepare(site)
        probes = load_probes(site, ProbeSettings.of(self.settings), self.maps)
        self.kernels["gather"] = Replay(site.scene, partial(_looked_up, self.glossy, probes), probes.arrays)

    def render(self, view: View, stages: Stages) -> Prediction:
        """Emission and diffuse light at the first hits, then the glossy light from the probes."""
        fine = self.fine(view)
        camera = camera_arrays(view.camera, fine)
        with stages.stage("g-buffer"):
            point, glossy, matte = self.kernels["g-buffer"](camera, *fine)
        with stages.stage("gather"):
            position = mi.Point3f(list(view.camera.position))
            dr.make_opaque(position)
            found = self.kernels["gather"](point, glossy, position, tuple(self.settings.items()))
            specular = averaged(found, fine, self.grid)
            return Prediction(averaged(matte, fine, self.grid) + specular, specular)


def _looked_up(lookup: Callable[..., Any], probes: Probes, point, glossy, camera, settings) -> Any:
    """settings: as pairs; they are part of the recording, so that others are recorded anew."""
    value = dr.select(glossy, lookup(probes, point, camera, glossy, dict(settings)), 0)
    dr.eval(value)
    return value
