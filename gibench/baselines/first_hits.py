"""First hits of a frame's camera rays, as Dr.Jit arrays that stay on the device: where every deferred method begins."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.rendering import flags
from gibench.rendering.camera import PinholeCamera, RayGenerator
from gibench.rendering.scene import Scene


@dataclass
class FirstHits:
    """Camera rays through a regular grid and what they hit; every array has a lane a grid point, in row order.

    resolution: (width, height) of the grid. ray: mi.Ray3f. preliminary: mi.PreliminaryIntersection3f, whose
    prim_index and prim_uv say where on which triangle. si: mi.SurfaceInteraction3f, its wi towards the viewer.
    bsdf: mi.BSDFPtr. active: whether something was hit. emission: mi.Color3f, radiance seen straight, environment
    included.
    """

    resolution: tuple[int, int]
    ray: Any
    preliminary: Any
    si: Any
    bsdf: Any
    active: Any
    emission: Any

    @property
    def glossy(self) -> Any:
        """mi.Bool, whether something was hit that reflects other than diffusely."""
        return self.active & ((self.bsdf.flags() & flags.NOT_DIFFUSE) != 0)

    @property
    def normal(self) -> Any:
        """Unit mi.Vector3f, the shading normal towards the viewer; 0 on a miss."""
        return dr.select(self.active, mi.Vector3f(dr.mulsign(self.si.sh_frame.n, self.si.wi.z)), 0)


def first_hits(
    scene: Scene, camera: PinholeCamera, resolution: tuple[int, int], *, grid: int = 1
) -> FirstHits:
    """Trace a grid of camera rays.

    grid: rays along each side of a pixel, at the centres of its cells; the reference averages over the pixel, so
    one ray at its centre costs edges dearly. Average with `pixels`. Needs a vectorised variant.
    """
    fine = (resolution[0] * grid, resolution[1] * grid)
    return hits_of_rays(scene, RayGenerator(camera, fine), fine)


def hits_of_rays(
    scene: Scene, generator: RayGenerator, resolution: tuple[int, int], preliminary: Any = None
) -> FirstHits:
    """One ray through the centre of each cell of a generator's grid.

    resolution: (width, height) of that grid. preliminary: what the rays hit, where an earlier kernel has found it: a
    few numbers a ray, from which all others are computed anew for less than it takes to store them.
    """
    width, height = resolution
    lane = dr.arange(mi.UInt32, width * height)
    columns = dr.opaque(mi.UInt32, width)
    row = lane // columns
    centre = mi.Point2f(mi.Float(lane - row * columns) + 0.5, mi.Float(row) + 0.5)
    ray = generator.rays(centre)
    if preliminary is None:
        preliminary = scene.mi_scene.ray_intersect_preliminary(ray, coherent=True)
    si = preliminary.compute_surface_interaction(ray, mi.RayFlags.All)
    emission = si.emitter(scene.mi_scene).eval(si)
    active = si.is_valid()
    return FirstHits((width, height), ray, preliminary, si, si.bsdf(ray), active, emission)


def pixels(values: Any, hits: FirstHits, grid: int = 1) -> Any:
    """A mi.Color3f of the grid as an image, each pixel the mean of its grid × grid rays.

    Returns a mi.TensorXf (height, width, 3), evaluated, that stays on the device.
    """
    return averaged(values, hits.resolution, grid)


def averaged(values: Any, resolution: tuple[int, int], grid: int = 1) -> Any:
    """`pixels` of a grid of which only the resolution (width, height) is at hand."""
    width, height = resolution[0] // grid, resolution[1] // grid
    pixel = dr.arange(mi.UInt32, width * height)
    columns = dr.opaque(mi.UInt32, width)  # one kernel for all sizes
    row = pixel // columns
    corner = (row * columns * grid + (pixel - row * columns)) * grid
    total = mi.Color3f(0)
    for down in range(grid):
        for across in range(grid):
            total += mi.Color3f(*(_lane(part, corner + down * columns * grid + across) for part in values))
    image = mi.TensorXf(dr.ravel(total * (1 / grid**2)), (height, width, 3))
    dr.eval(image)
    return image


def _lane(values: Any, index: Any) -> Any:
    return values if dr.width(values) == 1 else dr.gather(mi.Float, values, index)
