"""The method `isg`: a mirror image shaded from the lightmap, blurred on the screen."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import math
from collections.abc import Mapping

import drjit as dr
import mitsuba as mi

from gibench.baselines.first_hits import averaged, hits_of_rays
from gibench.baselines.image_space_gathering.gathering import gather
from gibench.baselines.image_space_gathering.pyramid import Layout, MirrorImage, Pyramid
from gibench.baselines.image_space_gathering.reflectance import directional_albedo, specular_context
from gibench.baselines.lightmap.bake import baked_lightmap
from gibench.baselines.method import Prediction, Setting, Site, View
from gibench.baselines.replay import Replay, arrays_of, camera_arrays, ray_generator
from gibench.baselines.stages import Stages
from gibench.rendering import surface


class ImageSpaceGathering:
    """See `gibench.baselines.image_space_gathering.METHOD`."""

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
        held = arrays_of(self._lightmap)
        self._surfaces = Replay(site.scene, self._gbuffer, held)
        self._mirror = Replay(site.scene, self._mirrored, held)
        self._gather = Replay(site.scene, self._gathered)

    def render(self, view: View, stages: Stages) -> Prediction:
        """Mirror image, gather, and the reflectance over it."""
        grid = self._grid
        fine = (view.resolution[0] * grid, view.resolution[1] * grid)
        camera = camera_arrays(view.camera, fine)
        with stages.stage("g-buffer"):
            preliminary, seen, surfaces = self._surfaces(camera, *fine)
            base = averaged(seen, fine, grid)
        with stages.stage("ray casting"):
            radiance, blur = self._mirror(camera, preliminary, surfaces["glossy"], *fine)
        with stages.stage("gather"):
            focal = dr.opaque(mi.Float, view.camera.focal_length(fine[0]))
            taps = dr.opaque(mi.UInt32, int(self._settings["taps"]))
            layout = Layout(*fine)
            specular = averaged(
                self._gather(surfaces, preliminary.t, radiance, blur, focal, taps, layout.arrays, *fine),
                fine,
                grid,
            )
        return Prediction(color=base + specular, specular=specular)

    def _gbuffer(self, camera, width: int, height: int):
        """What was hit, what it sends out but for glossy light, and what the gather must know of it."""
        hits = hits_of_rays(self._scene, ray_generator(camera), (width, height))
        seen = hits.emission + self._lightmap.diffuse(hits.si, hits.preliminary, hits.active)
        glossy = hits.active & ((hits.bsdf.flags() & specular_context().type_mask) != 0)
        surfaces = {
            "glossy": glossy,
            "reflectance": directional_albedo(hits.si, hits.bsdf, glossy),
            "position": mi.Point3f(hits.si.p),
            "normal": dr.mulsign(hits.si.sh_frame.n, hits.si.wi.z),
            "roughness": surface.roughness(hits.bsdf, hits.si, glossy),
            "cosine": dr.abs(hits.si.wi.z),
        }
        dr.eval(hits.preliminary, seen, surfaces)
        return hits.preliminary, seen, surfaces

    def _mirrored(self, camera, preliminary, glossy, width: int, height: int):
        """What each glossy hit would reflect if it were a mirror, and d_r / (d_c + d_r) there."""
        scene = self._scene.mi_scene
        first = hits_of_rays(self._scene, ray_generator(camera), (width, height), preliminary).si
        ray = first.spawn_ray(first.to_world(mi.reflect(first.wi)))
        found = scene.ray_intersect_preliminary(ray, coherent=False, active=glossy)
        hit = found.compute_surface_interaction(ray, mi.RayFlags.All, glossy)
        radiance = hit.emitter(scene).eval(hit, glossy) + self._lightmap.diffuse(hit, found, glossy)
        # 1 for the environment, which is infinitely far away.
        blur = dr.select(hit.is_valid(), hit.t / (first.t + hit.t), 1)
        result = mi.Color3f(dr.select(glossy, radiance, 0)), dr.select(glossy, blur, 0)
        dr.eval(result)
        return result

    def _gathered(self, surfaces, distance, radiance, blur, focal, taps, layout, width: int, height: int):
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
