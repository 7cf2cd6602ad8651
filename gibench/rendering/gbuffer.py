"""Surface, reflection, curvature and motion channels, point-sampled at pixel centres in one kernel.

Conventions as in `channels`. A miss holds 0 everywhere. Only what is asked for is computed.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.rendering import flags, surface
from gibench.rendering.backend import is_scalar
from gibench.rendering.camera import PinholeCamera, RayGenerator
from gibench.rendering.channels import CHANNELS, SETS
from gibench.rendering.integrator import bsdf_at, shading_normal
from gibench.rendering.replay import camera_arrays, ray_generator, replayed
from gibench.rendering.scene import Scene

VISIBILITY_TOLERANCE = 1e-3
"""Relative difference of distance below which a point counts as the one that the earlier camera saw."""

SURFACE_SETS = ("surface", "reflection", "curvature", "motion", "lighting")
"""Sets of channels that are found here; of the last one the direction alone."""


def mirror_direction(si: Any, towards: Any) -> Any:
    """Unit mi.Vector3f that a ray of direction `towards` takes from a hit `si` if the surface is a mirror.

    It stays on the side of the surface that the ray comes from.
    """
    shading, face = (towards - 2 * dr.dot(towards, n) * n for n in (si.sh_frame.n, si.n))
    # Interpolated normals can send it through the surface near a silhouette: there the face decides.
    leaves = dr.dot(shading, si.n) * dr.dot(towards, si.n) < 0
    return dr.normalize(dr.select(leaves, shading, face))


class Hit:
    """Hits of rays, with the terms that several channels share.

    rays: mi.Ray3f. si: mi.SurfaceInteraction3f. valid: whether there is something. bsdf: mi.BSDFPtr.
    """

    def __init__(self, scene: Scene, rays: Any, ray_flags: Any) -> None:
        """ray_flags: mi.RayFlags, what is computed of the surface."""
        self.scene = scene
        self.rays = rays
        self.preliminary = scene.mi_scene.ray_intersect_preliminary(rays, coherent=True)
        self.si = self.preliminary.compute_surface_interaction(rays, ray_flags)
        self.valid = self.si.is_valid()
        self.bsdf = bsdf_at(self.si, rays)

    def facing(self, normal: Any) -> Any:
        """`normal`, turned towards where the ray came from; 0 on a miss."""
        turned = dr.select(dr.dot(self.si.n, self.rays.d) > 0, -normal, normal)
        return dr.select(self.valid, turned, 0)

    @property
    def normal(self) -> Any:
        """Unit mi.Vector3f, the shading normal on the side that the ray came from; 0 on a miss."""
        return self.facing(shading_normal(self.si))

    def mirrored(self) -> Hit:
        """The hit of the mirror ray."""
        rays = self.si.spawn_ray(mirror_direction(self.si, self.rays.d))
        rays.maxt = dr.select(self.valid, rays.maxt, 0)
        return Hit(self.scene, rays, mi.RayFlags.All)

    def masked(self, value: Any) -> Any:
        """`value`, 0 on a miss."""
        return dr.select(self.valid, value, 0)


def _motion(hit: Hit, pixel: Any, previous: RayGenerator | None) -> tuple[Any, Any]:
    """Offset (pixels) to where the earlier camera saw the point, and whether it did see it there."""
    if previous is None:
        return mi.Vector2f(dr.zeros(mi.Float, dr.width(pixel))), dr.zeros(mi.Float, dr.width(pixel))
    film, depth = previous.project(hit.si.p)
    ahead = hit.valid & (depth > 0)
    offset = mi.Vector2f(film - pixel)
    ahead &= dr.all(dr.isfinite(offset))
    offset = dr.select(ahead, offset, 0)
    inside = ahead & dr.all((film >= 0) & (film < previous.size))
    origin = previous.origin
    towards = hit.si.p - origin
    distance = dr.norm(towards)
    ray = mi.Ray3f(origin, towards / distance)
    occluder = hit.scene.mi_scene.ray_intersect_preliminary(ray, coherent=False, active=inside).t
    visible = inside & (dr.abs(occluder - distance) <= VISIBILITY_TOLERANCE * distance)
    return offset, dr.select(visible, mi.Float(1), 0)


def _light_direction(hit: Hit) -> Any:
    """Towards the centre of the area light that lights the scene; 0 on a miss, and where no such light does."""
    lights = hit.scene.lights
    if lights is None:
        return mi.Vector3f(dr.zeros(mi.Float, dr.width(hit.si.p)))
    towards = lights.centre - hit.si.p
    length = dr.norm(towards)
    there = hit.valid & (lights.placed > 0) & (length > 0)
    return dr.select(there, towards / dr.select(there, length, 1), 0)


def _values(
    scene: Scene, wanted: Collection[str], generator: RayGenerator, previous: RayGenerator | None, pixel: Any
) -> dict[str, Any]:
    """Channels at film positions, as `surface_arrays` returns them."""
    bent = not set(SETS["curvature"]).isdisjoint(wanted)
    hit = Hit(scene, generator.rays(pixel), flags.HIT_WITH_CURVATURE if bent else mi.RayFlags.All)
    names: dict[str, Callable[[], Any]] = {
        "position": lambda: hit.masked(hit.si.p),
        "normal": lambda: hit.normal,
        "geometric_normal": lambda: hit.facing(hit.si.n),
        "depth": lambda: hit.masked(hit.si.t * dr.dot(hit.rays.d, generator.forward)),
        "distance": lambda: hit.masked(hit.si.t),
        "albedo": lambda: surface.albedo(scene, hit.bsdf, hit.si, hit.valid),
        "specular_albedo": lambda: surface.specular_albedo(scene, hit.bsdf, hit.si, hit.valid),
        "roughness": lambda: surface.roughness(scene, hit.bsdf, hit.si, hit.valid),
        "material_id": lambda: scene.material_ids(hit.bsdf, hit.valid),
        "shape_id": lambda: scene.shape_ids(hit.si.shape, hit.valid),
        "light_direction": lambda: _light_direction(hit),
    }
    if not set(SETS["reflection"]).isdisjoint(wanted):
        mirror = hit.mirrored()
        names |= {
            "reflected_position": lambda: mirror.masked(mirror.si.p),
            "reflected_normal": lambda: mirror.normal,
            "reflected_albedo": lambda: surface.albedo(scene, mirror.bsdf, mirror.si, mirror.valid),
            "reflected_distance": lambda: mirror.masked(mirror.si.t),
            "reflected_material_id": lambda: scene.material_ids(mirror.bsdf, mirror.valid),
            "reflected_shape_id": lambda: scene.shape_ids(mirror.si.shape, mirror.valid),
        }
    if bent:
        first, second, direction = scene.curvature.principal(hit.si, hit.preliminary)
        names |= {
            "curvature": lambda: mi.Vector2f(first, second),
            "curvature_direction": lambda: direction,
        }
    if not set(SETS["motion"]).isdisjoint(wanted):
        offset, visible = _motion(hit, pixel, previous)
        names |= {"motion": lambda: offset, "motion_valid": lambda: visible}
    return {name: names[name]() for name in CHANNELS if name in wanted}


def surface_arrays(
    scene: Scene,
    wanted: Collection[str],
    camera: dict[str, Any],
    width: Any,
    pixels: int,
    previous: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """The surface-like channels of a frame on the device, evaluated: name → mi.Vector3f, mi.Float, mi.UInt32 …

    wanted: names of channels. camera, previous: `replay.camera_arrays` of this frame and of the one before it on its
    path. width: mi.UInt32, of the frame. pixels: a lane each, in row order. A function for a `Replay`, which must hold
    `scene.curvature.arrays` where curvature is wanted. Needs a vectorised variant.
    """
    index = dr.arange(mi.UInt32, pixels)
    row = index // width
    pixel = mi.Point2f(mi.Float(index - row * width) + 0.5, mi.Float(row) + 0.5)
    before = ray_generator(previous) if previous else None
    values = _values(scene, wanted, ray_generator(camera), before, pixel)
    dr.eval(values)
    return values


def render_gbuffer(
    scene: Scene,
    camera: PinholeCamera,
    resolution: tuple[int, int],
    channels: Sequence[str],
    *,
    previous_camera: PinholeCamera | None = None,
) -> dict[str, NDArray[Any]]:
    """The surface-like channels of one frame.

    resolution: (width, height). channels: names from the sets in SURFACE_SETS. previous_camera: of the frame before
    it on a path; without one, motion is 0 and nowhere valid. Returns name → (H, W, C), float32 or uint32.
    """
    wanted = tuple(name for name in CHANNELS if name in channels)
    if not wanted:
        return {}
    width, height = resolution
    if is_scalar():
        generator = RayGenerator(camera, resolution)
        before = None if previous_camera is None else RayGenerator(previous_camera, resolution)
        pixels = [
            _values(scene, wanted, generator, before, mi.Point2f(x + 0.5, y + 0.5))
            for y in range(height)
            for x in range(width)
        ]
        columns = {name: np.array([p[name] for p in pixels]).reshape(len(pixels), -1) for name in wanted}
    else:
        held = [] if set(SETS["curvature"]).isdisjoint(wanted) else [scene.curvature.arrays]
        kernel = replayed(scene, ("surface", wanted), partial(_arrays, wanted), *held)
        past = {} if previous_camera is None else camera_arrays(previous_camera, resolution)
        across = dr.opaque(mi.UInt32, width)  # one kernel for all sizes
        found = kernel(camera_arrays(camera, resolution), across, width * height, past)
        # Component by component: a vector as a whole would be interleaved by a kernel of its own for every size.
        columns = {
            name: np.stack(
                [np.array(part) for part in (value if dr.depth_v(value) > 1 else [value])], axis=-1
            )
            for name, value in found.items()
        }
    return {
        name: np.ascontiguousarray(columns[name])
        .reshape(height, width, CHANNELS[name].components)
        .astype(np.uint32 if CHANNELS[name].dtype == "uint" else np.float32)
        for name in wanted
    }


def _arrays(wanted: tuple[str, ...], scene: Scene, *arguments: Any) -> dict[str, Any]:
    return surface_arrays(scene, wanted, *arguments)
