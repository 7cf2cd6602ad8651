"""Surface, reflection, curvature and motion channels, point-sampled at pixel centres in one kernel.

Conventions as in `channels`. A miss holds 0 everywhere. Only what is asked for is computed.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.rendering import surface
from gibench.rendering.backend import is_scalar
from gibench.rendering.camera import PinholeCamera, RayGenerator
from gibench.rendering.channels import CHANNELS, SETS
from gibench.rendering.curvature import FLAGS
from gibench.rendering.integrator import bsdf_at, shading_normal
from gibench.rendering.scene import Scene

VISIBILITY_TOLERANCE = 1e-3
"""Relative difference of distance below which a point counts as the one that the earlier camera saw."""

SURFACE_SETS = ("surface", "reflection", "curvature", "motion")


def mirror_direction(si: Any, towards: Any) -> Any:
    """Unit mi.Vector3f that a ray of direction `towards` takes from a hit `si` if the surface is a mirror.

    It stays on the side of the surface that the ray comes from.
    """
    shading, face = (towards - 2 * dr.dot(towards, n) * n for n in (si.sh_frame.n, si.n))
    # Interpolated normals can send it through the surface near a silhouette: there the face decides.
    leaves = dr.dot(shading, si.n) * dr.dot(towards, si.n) < 0
    return dr.normalize(dr.select(leaves, shading, face))


class Hit:
    """What rays hit, with what several channels share.

    rays: mi.Ray3f. si: mi.SurfaceInteraction3f. valid: whether there is something. bsdf: mi.BSDFPtr.
    """

    def __init__(self, scene: Scene, rays: Any, flags: Any) -> None:
        """flags: mi.RayFlags, what is computed of the surface."""
        self.scene = scene
        self.rays = rays
        self.preliminary = scene.mi_scene.ray_intersect_preliminary(rays, coherent=True)
        self.si = self.preliminary.compute_surface_interaction(rays, flags)
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


def _motion(
    hit: Hit, pixel: Any, previous: PinholeCamera | None, resolution: tuple[int, int]
) -> tuple[Any, Any]:
    """Offset (pixels) to where the earlier camera saw the point, and whether it did see it there."""
    if previous is None:
        return mi.Vector2f(dr.zeros(mi.Float, dr.width(pixel))), dr.zeros(mi.Float, dr.width(pixel))
    generator = RayGenerator(previous, resolution)
    film, depth = generator.project(hit.si.p)
    ahead = hit.valid & (depth > 0)
    offset = mi.Vector2f(film - pixel)
    ahead &= dr.all(dr.isfinite(offset))
    offset = dr.select(ahead, offset, 0)
    inside = ahead & dr.all((film >= 0) & (film < 2 * generator.centre))
    origin = generator.origin
    towards = hit.si.p - origin
    distance = dr.norm(towards)
    ray = mi.Ray3f(origin, towards / distance)
    seen = hit.scene.mi_scene.ray_intersect_preliminary(ray, coherent=False, active=inside).t
    visible = inside & (dr.abs(seen - distance) <= VISIBILITY_TOLERANCE * distance)
    return offset, dr.select(visible, mi.Float(1), 0)


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
    wanted = set(channels)
    if not wanted:
        return {}
    width, height = resolution
    scalar = is_scalar()
    flags = mi.RayFlags.All
    if wanted & set(SETS["curvature"]):
        flags = FLAGS
    generator = RayGenerator(camera, resolution)

    def values(pixel: Any) -> dict[str, list[Any]]:
        hit = Hit(scene, generator.rays(pixel), flags)
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
        }
        if wanted & set(SETS["reflection"]):
            mirror = hit.mirrored()
            names |= {
                "reflected_position": lambda: mirror.masked(mirror.si.p),
                "reflected_normal": lambda: mirror.normal,
                "reflected_albedo": lambda: surface.albedo(scene, mirror.bsdf, mirror.si, mirror.valid),
                "reflected_distance": lambda: mirror.masked(mirror.si.t),
                "reflected_material_id": lambda: scene.material_ids(mirror.bsdf, mirror.valid),
                "reflected_shape_id": lambda: scene.shape_ids(mirror.si.shape, mirror.valid),
            }
        if wanted & set(SETS["curvature"]):
            first, second, direction = scene.curvature.principal(hit.si, hit.preliminary)
            names |= {
                "curvature": lambda: mi.Vector2f(first, second),
                "curvature_direction": lambda: direction,
            }
        if wanted & set(SETS["motion"]):
            offset, seen = _motion(hit, pixel, previous_camera, resolution)
            names |= {"motion": lambda: offset, "motion_valid": lambda: seen}
        computed = {name: names[name]() for name in wanted}
        return {name: list(v) if CHANNELS[name].components > 1 else [v] for name, v in computed.items()}

    if scalar:
        pixels = [values(mi.Point2f(x + 0.5, y + 0.5)) for y in range(height) for x in range(width)]
        columns = {name: np.array([p[name] for p in pixels]) for name in wanted}
    else:
        index = dr.arange(mi.UInt32, width * height)
        across = dr.opaque(mi.UInt32, width)  # one kernel for all sizes
        row = index // across
        result = values(mi.Point2f(mi.Float(index - row * across) + 0.5, mi.Float(row) + 0.5))
        dr.eval(result)
        columns = {name: np.stack([np.array(c) for c in parts], axis=-1) for name, parts in result.items()}
    return {
        name: columns[name]
        .reshape(height, width, CHANNELS[name].components)
        .astype(np.uint32 if CHANNELS[name].dtype == "uint" else np.float32)
        for name in CHANNELS
        if name in wanted
    }
