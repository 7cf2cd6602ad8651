"""Diffuse light at points of triangles, path-traced, and which points lie hidden inside or under something."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.baselines.lightmap.coverage import Coverage
from gibench.baselines.lightmap.unwrapping import Unwrapping
from gibench.rendering.estimate import LANES, MAXIMUM_LEVELS
from gibench.rendering.integrator import scatter_paths
from gibench.rendering.lobes import diffuse_lobe
from gibench.rendering.sampling import StratifiedSampler
from gibench.rendering.scene import Scene

PROBES = 8
"""Rays, a power of two, that tell whether a point is hidden."""

BURIED = 0.25
"""Share of rays that meet the back of a mesh first, above which a point is inside something. Meshes are closed: none
does so outside, all do inside, and half on the very plane of another wall."""

COVERED_SHARE = 7 / 8
COVERED_DISTANCE = 0.01
"""A point where at least this share of rays ends within this distance (m) is covered: a floor below a rug. No camera
sees it but through a gap of its size."""

BLACK = 1e-6
"""BSDF values below this reflect nothing, and light divided by them would be noise."""


class TexelPoints:
    """The points of a coverage on the device."""

    def __init__(self, scene: Scene, unwrapping: Unwrapping, coverage: Coverage) -> None:
        """Under a vectorised variant."""
        self.scene = scene
        self._shapes = scene.mi_scene.shapes_dr()
        self._shape = mi.UInt32(unwrapping.shapes[coverage.faces].astype(np.uint32))
        self._triangle = mi.UInt32(unwrapping.triangles[coverage.faces].astype(np.uint32))
        self._uv = mi.Point2f(np.ascontiguousarray(coverage.barycentrics.T))
        dr.make_opaque(self._shape, self._triangle, self._uv)

    def preliminary(self, point: Any) -> Any:
        """mi.PreliminaryIntersection3f as if a ray had hit the points of these numbers (mi.UInt32)."""
        hit = dr.zeros(mi.PreliminaryIntersection3f, dr.width(point))
        hit.valid, hit.t = mi.Bool(True), mi.Float(1)
        hit.shape = dr.gather(mi.ShapePtr, self._shapes, dr.gather(mi.UInt32, self._shape, point))
        hit.prim_index = dr.gather(mi.UInt32, self._triangle, point)
        hit.prim_uv = dr.gather(mi.Point2f, self._uv, point)
        return hit

    def interaction(self, point: Any) -> Any:
        """mi.SurfaceInteraction3f there, seen along the shading normal."""
        ray = mi.Ray3f(mi.Point3f(0), mi.Vector3f(0, 0, 1))  # only its direction would matter, for wi
        si = self.preliminary(point).compute_surface_interaction(ray, mi.RayFlags.All)
        si.wi = mi.Vector3f(0, 0, 1)
        return si


def hidden(points: TexelPoints, count: int) -> NDArray[np.bool_]:
    """Mask of the `count` points that are buried or covered, (count,)."""
    result = np.zeros(count, dtype=bool)
    step = LANES // PROBES
    for start in range(0, count, step):
        size = min(step, count - start)
        lane = dr.arange(mi.UInt32, size * PROBES)
        point = lane // PROBES + dr.opaque(mi.UInt32, start)
        probe = lane & (PROBES - 1)
        si = points.interaction(point)
        # One cosine-distributed direction a stratum of azimuth, elevations by the bits of the number reversed.
        u = mi.Point2f((mi.Float(dr.brev(probe)) * 2.0**-32 + 0.5 / PROBES), (mi.Float(probe) + 0.5) / PROBES)
        sine = dr.sqrt(u.x)
        angle = dr.two_pi * u.y
        direction = mi.Vector3f(sine * dr.cos(angle), sine * dr.sin(angle), dr.sqrt(1 - u.x))
        # Around the geometric normal: the shading normal may dip below the triangle.
        ray = si.spawn_ray(mi.Frame3f(si.n).to_world(direction))
        hit = points.scene.mi_scene.ray_intersect(ray, mi.RayFlags.Minimal, False)
        back = hit.is_valid() & hit.shape.is_mesh() & (dr.dot(hit.n, ray.d) > 0)
        near = hit.is_valid() & (hit.t < COVERED_DISTANCE)
        backs, nears = dr.select(back, mi.Float(1), 0), dr.select(near, mi.Float(1), 0)
        dr.eval(backs, nears)
        backs, nears = dr.block_sum(backs, PROBES), dr.block_sum(nears, PROBES)
        dr.eval(backs, nears)
        result[start : start + size] = (np.array(backs) > BURIED * PROBES) | (
            np.array(nears) >= COVERED_SHARE * PROBES
        )
    return result


def trace_texels(
    points: TexelPoints, first: NDArray[np.int64], *, spp: int, max_depth: int, seed: int
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Diffuse radiance over the value of the diffuse lobe, averaged over the points of each texel.

    first: (T + 1,), where the points of each texel begin, at least one a texel. spp: paths a texel, a power of two.
    Returns (T, 3) in W·m⁻² (the irradiance, where the lobe is Lambert's) and whether that component is known: it is
    not where the material is black.
    """
    texels = len(first) - 1
    sums, known = np.zeros((texels, 3)), np.zeros((texels, 3))
    begin, number = mi.UInt32(first[:-1].astype(np.uint32)), mi.Float(np.diff(first).astype(np.float32))
    dr.make_opaque(begin, number)
    samples = min(spp, 4**MAXIMUM_LEVELS)
    step = max(LANES // samples, 1)
    for start in range(0, texels, step):
        size = min(step, texels - start)
        for done in range(0, spp, samples):
            launch_seed = (seed + (start // step) * spp + done) * 0x9E3779B1 % 2**32
            ratio, is_known = _launch(points, begin, number, start, size, samples, max_depth, launch_seed)
            sums[start : start + size] += ratio
            known[start : start + size] += is_known
    return np.divide(sums, known, out=np.zeros_like(sums), where=known > 0).astype(np.float32), known > 0


def _launch(points, begin, number, start, size, samples, max_depth, seed):
    """Sums over `samples` paths of each of `size` texels: light over lobe, and how many paths tell."""
    # Both ask Mitsuba for its flags, so a variant is needed.

    lanes = size * samples
    levels = (samples.bit_length() - 1) // 2
    sampler = StratifiedSampler(seed, lanes, levels)
    texel = dr.arange(mi.UInt32, lanes) // dr.opaque(mi.UInt32, samples) + dr.opaque(mi.UInt32, start)
    among = dr.gather(mi.Float, number, texel)
    place = dr.minimum(sampler.next_1d() * among, among - 1)
    si = points.interaction(dr.gather(mi.UInt32, begin, texel) + mi.UInt32(place))
    bsdf = si.bsdf()
    lobe = diffuse_lobe(points.scene.layers, bsdf, si, mi.Vector3f(0, 0, 1), mi.Bool(True))
    path = scatter_paths(
        points.scene.mi_scene,
        sampler,
        si,
        bsdf,
        mi.Bool(True),
        max_depth=max_depth,
        lobes="diffuse",
        portals=points.scene.portals,
        layers=points.scene.layers,
        guide=points.scene.guide,
    )
    light = path.direct_diffuse + path.indirect_diffuse
    tells = [dr.isfinite(value) & (over > BLACK) for value, over in zip(light, lobe, strict=True)]
    ratio = [
        dr.select(told, value / dr.maximum(over, BLACK), 0)
        for told, value, over in zip(tells, light, lobe, strict=True)
    ]
    counts = [dr.select(told, mi.Float(1), 0) for told in tells]
    dr.eval(ratio, counts)
    sums = [dr.block_sum(value, samples) for value in (*ratio, *counts)]
    dr.eval(sums)
    result = np.stack([np.array(value) for value in sums], axis=-1)
    return result[:, :3], result[:, 3:]
