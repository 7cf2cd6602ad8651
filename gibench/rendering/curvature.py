"""Principal curvatures at hits: how fast the shading normal turns, which is what bends reflections.

On meshes from tables (`mesh_curvature`), on other shapes from Mitsuba's derivatives of the normal, by Weingarten's
equations: exact.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.rendering.backend import is_scalar, registry_key
from gibench.rendering.mesh_curvature import corner_tensors

UMBILIC_TOLERANCE = 1e-4
"""Relative difference of the principal curvatures below which they count as equal."""

NONE = 0xFFFFFFFF
"""Offset of a shape without a table."""


class Curvature:
    """Curvature of a scene's surfaces. arrays: what a `Replay` must hold."""

    def __init__(self, shapes: list[Any]) -> None:
        """shapes: of a scene, under the current variant."""
        tables: list[NDArray[np.float64]] = []
        self._first: dict[int, int] = {}  # key of a shape → its first triangle
        self._all_meshes = True
        count = 0
        for shape in shapes:
            if not shape.is_mesh():
                self._all_meshes = False
                continue
            self._first[registry_key("ShapePtr", shape)] = count
            tables.append(_table(shape))
            count += len(tables[-1])
        self._table = np.concatenate([*tables, np.zeros((1, 3, 6))]).astype(np.float32).reshape(-1, 2, 3)
        self.arrays: list[Any] = []
        if is_scalar():
            return
        offsets = np.full(max(self._first, default=0) + 1, NONE, dtype=np.uint32)
        offsets[list(self._first)] = list(self._first.values())
        self.arrays = [mi.Float(self._table.ravel()), mi.UInt32(offsets)]
        dr.make_opaque(self.arrays)

    def principal(self, si: Any, preliminary: Any, active: Any = True) -> tuple[Any, Any, Any]:
        """The principal curvatures (1/m), the larger in size first, and the unit direction of the first.

        si: mi.SurfaceInteraction3f, computed with `flags.HIT_WITH_CURVATURE` (a mesh does without); preliminary: the
        mi.PreliminaryIntersection3f it is from. Positive where the surface bends towards the side that si.wi is on. The
        direction is in the plane of the shading normal. 0 on a miss and where the surface is no surface.
        """
        active = active & si.is_valid()
        s, t = si.sh_frame.s, si.sh_frame.t
        xx, yy, xy, meshed = self._on_meshes(si, preliminary, s, t, active)
        if not self._all_meshes:
            others = _by_derivatives(si, s, t, active & ~meshed if not is_scalar() else active and not meshed)
            xx, yy, xy = (dr.select(meshed, a, b) for a, b in zip((xx, yy, xy), others, strict=True))
        mean, half = 0.5 * (xx + yy), 0.5 * (xx - yy)
        root = dr.sqrt(dr.square(half) + dr.square(xy))
        first = dr.select(mean >= 0, mean + root, mean - root)
        second = dr.select(mean >= 0, mean - root, mean + root)
        angle = 0.5 * dr.atan2(xy, half) + dr.select(mean >= 0, 0, 0.5 * dr.pi)
        direction = dr.cos(angle) * s + dr.sin(angle) * t
        # On a sphere every direction is principal: take the frame's rather than rounding noise.
        direction = dr.select(root > UMBILIC_TOLERANCE * dr.abs(mean), direction, s)
        flip = dr.select(dr.dot(si.n, si.to_world(si.wi)) < 0, -1, 1)
        flip *= dr.select(dr.dot(si.n, si.sh_frame.n) < 0, -1, 1)
        usable = active & dr.isfinite(first) & dr.isfinite(second)
        return (
            dr.select(usable, first * flip, 0),
            dr.select(usable, second * flip, 0),
            dr.select(usable, direction, 0),
        )

    def _on_meshes(self, si, preliminary, s, t, active):
        """The second fundamental form along s, s; t, t and s, t, and whether the hit is on a mesh."""
        if is_scalar():
            first = self._first.get(registry_key("ShapePtr", si.shape), NONE) if active else NONE
            meshed = first != NONE
        else:
            shape = dr.reinterpret_array(mi.UInt32, si.shape)
            known = active & (shape < dr.width(self.arrays[1]))
            first = dr.gather(mi.UInt32, self.arrays[1], shape, known)
            meshed = known & (first != NONE)
        row = dr.select(meshed, 3 * (first + preliminary.prim_index), 0)
        uv = preliminary.prim_uv
        diagonal, rest = mi.Vector3f(0), mi.Vector3f(0)
        for corner, weight in enumerate((1 - uv.x - uv.y, uv.x, uv.y)):
            diagonal += weight * self._entry(row + corner, 0, meshed)
            rest += weight * self._entry(row + corner, 1, meshed)

        def along(a, b):
            sides = mi.Vector3f(a.x * b.y + a.y * b.x, a.x * b.z + a.z * b.x, a.y * b.z + a.z * b.y)
            return dr.dot(diagonal, a * b) + dr.dot(rest, sides)

        return along(s, s), along(t, t), along(s, t), meshed

    def _entry(self, row, half, active):
        if is_scalar():
            return mi.Vector3f(self._table[int(row), half].tolist())
        return dr.gather(mi.Vector3f, self.arrays[0], 2 * row + half, active)


def _table(mesh: Any) -> NDArray[np.float64]:
    """Tensors at the corners of a mesh's triangles; 0 where it is shaded flat."""
    faces = np.array(mesh.faces_buffer()).reshape(-1, 3)
    if not mesh.has_vertex_normals():
        return np.zeros((len(faces), 3, 6))
    positions = np.array(mesh.vertex_positions_buffer()).reshape(-1, 3)
    normals = np.array(mesh.vertex_normals_buffer()).reshape(-1, 3)
    return corner_tensors(positions, -normals if mesh.has_flipped_normals() else normals, faces)


def _by_derivatives(si, s, t, active):
    """The second fundamental form along s, s; t, t and s, t from how position and normal change with u and v.

    Where u and v do not span the surface, 0.
    """
    a, b = dr.dot(si.dp_du, s), dr.dot(si.dp_dv, s)
    c, d = dr.dot(si.dp_du, t), dr.dot(si.dp_dv, t)
    determinant = a * d - b * c
    scale = dr.squared_norm(si.dp_du) * dr.squared_norm(si.dp_dv)
    usable = active & (dr.square(determinant) > 1e-10 * scale)
    inverse = dr.select(usable, dr.rcp(determinant), 0)
    along_s = (si.dn_du * d - si.dn_dv * c) * inverse
    along_t = (si.dn_dv * a - si.dn_du * b) * inverse
    # A surface that bends away from its normal spreads its normals: hence the sign.
    return -dr.dot(along_s, s), -dr.dot(along_t, t), -0.5 * (dr.dot(along_s, t) + dr.dot(along_t, s))
