"""Images of lights in flat mirrors, as lights of their own.

What a perfect mirror shows of a lamp is light that only a bounce meets: no light sample passes by the mirror, and a
small lamp behind it is met by few. The image of the lamp in the plane of the mirror is a lamp that can be sampled:
towards it the ray meets the mirror, and goes on to the lamp itself. Both ways are weighted by their densities, so that
the estimate is unbiased whichever mirrors are known (the specular chain of one flat mirror, for which the manifold
walks of Zeltner et al. 2020 have a closed form).
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.rendering.backend import registry_key
from gibench.rendering.children import children_of

SMALLEST = 0.02
"""Square metres of a flat mirror that has images."""

MOST_MIRRORS = 8
"""The largest have images: a kernel looks through all of them wherever a path meets a mirror."""

MOST_IMAGES = 64
"""The ones whose mirrors look largest from the lamp."""

ALIKE = 1e-5
"""One less the cosine between the normal of a mirror and that of a hit on it, for float32."""

APART = 1e-4
"""Metres between the plane of a mirror and a hit on it."""

_COLUMNS = 4


@dataclass(frozen=True)
class Plane:
    """A flat part of a shape: the points with normal·x = offset.

    shape: pointer to it, as a number. normal: (3,) unit, to the front. area: m². middle: (3,).
    """

    shape: int
    normal: NDArray[np.float64]
    offset: float
    area: float
    middle: NDArray[np.float64]


def flat_mirrors(mi_scene: Any, points: NDArray[np.float64]) -> list[Plane]:
    """The largest flat parts of perfect mirrors, largest first. points: (N, 3), free; some must lie before a mirror."""
    planes = []
    for shape in mi_scene.shapes():
        bsdf = shape.bsdf()
        if bsdf is not None and _is_mirror(bsdf) and not shape.is_emitter():
            planes += (fronts := _planes(shape))
            if bsdf.class_name() == "TwoSidedBRDF":
                # A sheet has a back. That of a slab is inside it.
                backs = (replace(p, normal=-p.normal, offset=-p.offset) for p in fronts)
                planes += [p for p in backs if (_corners(shape) @ p.normal < p.offset + APART).all()]
    seen = [p for p in planes if p.area >= SMALLEST and (points @ p.normal > p.offset + 1e-3).any()]
    # Shapes come in any order; which of several alike are taken must not depend on it.
    return sorted(seen, key=lambda p: (-p.area, *p.middle, *p.normal))[:MOST_MIRRORS]


def _corners(shape: Any) -> NDArray[np.float64]:
    """(8, 3), of the box around a shape."""
    box = shape.bbox()
    return np.array([np.array(box.corner(i)).ravel() for i in range(8)], dtype=np.float64)


def _is_mirror(bsdf: Any) -> bool:
    """Whether a material is a smooth conductor, on both sides or on its front."""
    if bsdf.class_name() == "TwoSidedBRDF":
        return all(_is_mirror(c) for c in children_of(bsdf) if isinstance(c, mi.BSDF))
    return bool(bsdf.class_name() == "SmoothConductor")


def _planes(shape: Any) -> list[Plane]:
    """The flat parts of a mesh, a rectangle or a disk, by their fronts."""
    key = registry_key("ShapePtr", shape)
    if shape.class_name() in ("Rectangle", "Disk"):
        at = shape.sample_position(0, mi.Point2f(0.5))
        point, normal = (np.array(a, dtype=np.float64).ravel() for a in (at.p, at.n))
        area = float(np.array(shape.surface_area()).item())
        return [Plane(key, normal, float(normal @ point), area, point)]
    if not shape.is_mesh():
        return []
    values = mi.traverse(shape)
    faces = np.array(values["faces"], dtype=np.int64).reshape(-1, 3)
    triangles = np.array(values["vertex_positions"], dtype=np.float64).reshape(-1, 3)[faces]
    normals = None
    if shape.has_vertex_normals() and not shape.has_face_normals():
        normals = np.array(values["vertex_normals"], dtype=np.float64).reshape(-1, 3)[faces]
    return _flat_parts(key, triangles, normals)


def _flat_parts(key: int, triangles: NDArray[Any], normals: NDArray[Any] | None) -> list[Plane]:
    """Planes of triangles that are shaded flat. triangles: (F, 3, 3). normals: (F, 3, 3) of the corners, or None."""
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    twice = np.linalg.norm(cross, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        normal = cross / twice[:, None]
    flat = twice > 0
    if normals is not None:
        # Shading normals on the other side turn the mirror round.
        turned = np.sign(np.einsum("fc,fc->f", np.nan_to_num(normal), normals[:, 0]))
        normal = normal * turned[:, None]
        flat &= (np.einsum("fc,fkc->fk", np.nan_to_num(normal), normals) > 1 - ALIKE / 10).all(axis=1)
    triangles, normal, twice = triangles[flat], normal[flat], twice[flat]
    offset = np.einsum("fc,fc->f", normal, triangles.mean(axis=1))
    # Of triangles that are alike to a millimetre together: a curved mirror has as many planes as triangles. Sums are of
    # twice the areas, so that a plane that rounding cuts in two passes.
    rounded = np.round(np.concatenate([normal, offset[:, None]], axis=1) * 1000)
    group = np.unique(rounded, axis=0, return_inverse=True)[1].ravel()
    sums = np.bincount(group, twice)
    planes, left = [], np.ones(len(group), dtype=bool)
    for number in np.argsort(-sums, kind="stable")[:MOST_MIRRORS]:
        members = np.flatnonzero(left & (group == number))
        if not len(members) or sums[number] < SMALLEST:
            continue
        largest = members[np.argmax(twice[members])]
        on = left & (normal @ normal[largest] > 1 - ALIKE / 10)
        on &= (np.abs(triangles @ normal[largest] - offset[largest]) < APART / 2).all(axis=1)
        on[largest] = True
        area = twice[on] / 2
        middle = np.average(triangles[on].mean(axis=1), axis=0, weights=area)
        planes.append(Plane(key, normal[largest], float(offset[largest]), float(area.sum()), middle))
        left &= ~on
    return planes


class Images:
    """Lights in flat mirrors, on the device. Mirrors count from 1; 0 stands for none.

    lights, mirrors: (I,) numbers of each image's light and mirror. arrays: those of the device.
    """

    def __init__(
        self, planes: list[Plane], lights: NDArray[np.uint32], mirrors: NDArray[np.uint32], count: int
    ) -> None:
        """count: of the lights."""
        self.lights, self.mirrors = lights, mirrors
        # Never one entry alone, which would make another kernel.
        self._shapes = mi.UInt32([*(p.shape for p in planes), 0])
        self._planes = mi.Float(np.array([[*p.normal, p.offset] for p in planes], dtype=np.float32).ravel())
        self._count = mi.UInt32(len(planes))
        self._lights = mi.UInt32(count)
        number = np.zeros((len(planes) + 1, count), dtype=np.uint32)
        number[mirrors, lights] = np.arange(len(lights)) + 1
        self._number = mi.UInt32(number.ravel())
        self._mirror = mi.UInt32([*mirrors.tolist(), 0])
        self.arrays = [self._shapes, self._planes, self._count, self._lights, self._number, self._mirror]
        dr.make_opaque(self.arrays)

    def mirror_of(self, image, active):
        """Mirrors of images, by number from 0 on; 0 where not active."""
        return dr.gather(mi.UInt32, self._mirror, image, active)

    def number(self, mirror, light, active):
        """One more than the number of a light's image in a mirror; 0 where there is none."""
        return dr.gather(mi.UInt32, self._number, mirror * self._lights + light, active & (mirror > 0))

    def _plane(self, mirror, active):
        at = (mirror - 1) * _COLUMNS
        n = mi.Vector3f(*(dr.gather(mi.Float, self._planes, at + i, active) for i in range(3)))
        return n, dr.gather(mi.Float, self._planes, at + 3, active)

    @dr.syntax
    def at(self, si, active):
        """The mirror that hits lie on and whose front they see; 0 for none."""
        found, mirror = mi.UInt32(0), mi.UInt32(0)
        shape = dr.reinterpret_array(mi.UInt32, si.shape)
        front = dr.mulsign(si.sh_frame.n, si.wi.z)
        looking = mi.Bool(active & si.is_valid())
        while looking & (mirror < self._count):
            n, offset = self._plane(mirror + 1, looking)
            on = dr.gather(mi.UInt32, self._shapes, mirror, looking) == shape
            on &= (dr.dot(n, front) > 1 - ALIKE) & (dr.abs(dr.dot(n, si.p) - offset) < APART)
            found = dr.select(on, mirror + 1, found)
            looking &= on ^ True
            mirror += 1
        return found

    def point(self, mirror, point, active):
        """Mirror images of points."""
        n, offset = self._plane(mirror, active)
        return dr.select(active, point - 2 * (dr.dot(n, point) - offset) * n, point)

    def direction(self, mirror, direction, active):
        """Mirror images of directions."""
        n, _ = self._plane(mirror, active)
        return dr.select(active, direction - 2 * dr.dot(n, direction) * n, direction)

    def before(self, mirror, point, active):
        """Whether points lie before the front of a mirror."""
        n, offset = self._plane(mirror, active)
        return dr.dot(n, point) > offset


def images_of(mi_scene: Any, emitters: list[Any], points: NDArray[np.float64]) -> Images | None:
    """Images of the area lights of a scene in its flat mirrors; None where there are none.

    emitters: `lights_of` the scene. points: (N, 3), free.
    """
    planes = flat_mirrors(mi_scene, points)
    shapes = {registry_key("EmitterPtr", s.emitter()): s for s in mi_scene.shapes() if s.is_emitter()}
    pairs = []
    for light, emitter in enumerate(emitters):
        shape = shapes.get(registry_key("EmitterPtr", emitter))
        if shape is None:
            continue
        corners = _corners(shape)
        for number, plane in enumerate(planes):
            if (corners @ plane.normal > plane.offset).any():
                distance = float(np.linalg.norm(corners.mean(axis=0) - plane.middle))
                pairs.append((-plane.area / max(distance, 1e-3) ** 2, light, number + 1))
    if not pairs:
        return None
    kept = np.array([pair[1:] for pair in sorted(pairs)[:MOST_IMAGES]], dtype=np.uint32)
    return Images(planes, kept[:, 0], kept[:, 1], len(emitters))
