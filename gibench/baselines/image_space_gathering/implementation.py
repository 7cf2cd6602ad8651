"""The method `isg`: a mirror image shaded from the lightmap, blurred on the screen."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import ClassVar

import drjit as dr
import mitsuba as mi

from gibench.baselines.first_hits import averaged, hits_of_rays
from gibench.baselines.image_space_gathering.gathering import gather
from gibench.baselines.image_space_gathering.pyramid import Layout, MirrorImage, Pyramid
from gibench.baselines.image_space_gathering.reflectance import directional_albedo
from gibench.baselines.lightmap.deferred import OnLightmap
from gibench.baselines.method import Prediction, Site, View
from gibench.baselines.stages import Stages
from gibench.baselines.transmission import seen_behind, transmits
from gibench.rendering import surface
from gibench.rendering.replay import camera_arrays, ray_generator


def _gbuffer(scene, lightmap, camera, width: int, height: int):
    """First hits, their radiance but for glossy light, and their surfaces for the gather."""
    hits = hits_of_rays(scene, ray_generator(camera), (width, height))
    base = hits.emission + lightmap.diffuse(hits.si, hits.preliminary, hits.active)
    glossy = hits.glossy
    surfaces = {
        "glossy": glossy,
        "reflectance": directional_albedo(scene.layers, hits.si, hits.bsdf, glossy),
        "position": mi.Point3f(hits.si.p),
        "normal": mi.Normal3f(hits.normal),
        "roughness": surface.roughness(scene, hits.bsdf, hits.si, glossy),
        "cosine": dr.abs(hits.si.wi.z),
    }
    dr.eval(hits.preliminary, base, surfaces)
    return hits.preliminary, base, surfaces


def _mirrored(scene, lightmap, camera, preliminary, glossy, width: int, height: int):
    """Radiance that each glossy hit would reflect if it were a mirror, and d_r / (d_c + d_r) there."""
    first = hits_of_rays(scene, ray_generator(camera), (width, height), preliminary).si
    ray = first.spawn_ray(first.to_world(mi.reflect(first.wi)))
    found = scene.mi_scene.ray_intersect_preliminary(ray, coherent=False, active=glossy)
    hit = found.compute_surface_interaction(ray, mi.RayFlags.All, glossy)
    radiance = hit.emitter(scene.mi_scene).eval(hit, glossy) + lightmap.diffuse(hit, found, glossy)
    # 1 for the environment, which is infinitely far away.
    blur = dr.select(hit.is_valid(), hit.t / (first.t + hit.t), 1)
    result = mi.Color3f(dr.select(glossy, radiance, 0)), dr.select(glossy, blur, 0)
    dr.eval(result)
    return result


def _gathered(
    _scene, _lightmap, surfaces, distance, radiance, blur, focal, taps, layout, width: int, height: int
):
    """The mirror image blurred by the lobe, times its reflectance."""
    image = MirrorImage(
        radiance,
        blur,
        surfaces["position"],
        surfaces["normal"],
        surfaces["roughness"],
        dr.select(surfaces["glossy"], mi.Float(1), mi.Float(0)),
    )
    # The solid angle of a lobe shrinks with the cosine of incidence: half vectors turn that much less.
    scale = focal * dr.sqrt(surfaces["cosine"])
    blurred = gather(Pyramid(image, Layout(width, height, layout)), scale, distance, taps)
    specular = dr.select(surfaces["glossy"], blurred * surfaces["reflectance"], 0)
    dr.eval(specular)
    return specular


class ImageSpaceGathering(OnLightmap):
    """See `gibench.baselines.image_space_gathering.METHOD`."""

    functions: ClassVar = {
        "g-buffer": _gbuffer,
        "mirror": _mirrored,
        "gather": _gathered,
        "behind": seen_behind,
    }

    def prepare(self, site: Site) -> None:
        """Bake the lightmap or find it."""
        super().prepare(site)
        self._transmits = transmits(site.scene.layers)

    def render(self, view: View, stages: Stages) -> Prediction:
        """Mirror image, gather, and the reflectance over it."""
        grid, fine = self.grid, self.fine(view)
        camera = camera_arrays(view.camera, fine)
        with stages.stage("g-buffer"):
            preliminary, base, surfaces = self.kernels["g-buffer"](camera, *fine)
            base = averaged(base, fine, grid)
        with stages.stage("ray casting"):
            radiance, blur = self.kernels["mirror"](camera, preliminary, surfaces["glossy"], *fine)
            behind = None
            if self._transmits:
                behind = averaged(self.kernels["behind"](camera, preliminary, *fine), fine, grid)
        with stages.stage("gather"):
            focal = dr.opaque(mi.Float, view.camera.focal_length(fine[0]))
            taps = dr.opaque(mi.UInt32, int(self.settings["taps"]))
            layout = Layout(*fine)
            specular = averaged(
                self.kernels["gather"](
                    surfaces, preliminary.t, radiance, blur, focal, taps, layout.arrays, *fine
                ),
                fine,
                grid,
            )
            if behind is not None:
                specular += behind
        return Prediction(color=base + specular, specular=specular)
