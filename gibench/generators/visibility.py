"""The first thing that a ray meets, asked of meshes in memory before any file is written."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gibench.generators.parts import FloatArray, IntArray, Mesh
from gibench.rendering.backend import select_variant

Surface = tuple[FloatArray, IntArray]  # vertices (V, 3), metres, and faces (F, 3)


class Caster(Protocol):
    """Casts rays at the meshes of things."""

    def cast(
        self, origins: FloatArray, directions: FloatArray
    ) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """As `RayCaster.cast`."""


class RayCaster:
    """Casts rays at a list of surfaces, under Mitsuba's current variant (or the best one where none is current).

    All surfaces go into one Mitsuba shape, and the triangle that was hit tells the owner: one shape builds faster
    than hundreds, and its kernel is compiled once for all rooms.
    """

    def __init__(self, surfaces: Sequence[Mesh | Surface], owners: Sequence[int]) -> None:
        """surfaces: world space. owners: what `cast` answers for each of them, ≥ 0."""
        select_variant()
        import mitsuba as mi

        bare = [(s.vertices, s.faces) if isinstance(s, Mesh) else s for s in surfaces]
        starts = np.cumsum([0, *(len(v) for v, _ in bare)])
        vertices = np.concatenate([v for v, _ in bare]).astype(np.float32)
        faces = np.concatenate([f + s for (_, f), s in zip(bare, starts, strict=False)]).astype(np.uint32)
        self._owner = np.repeat(np.asarray(owners), [len(f) for _, f in bare])
        shape = mi.Mesh("room", len(vertices), len(faces))
        parameters = mi.traverse(shape)
        parameters["vertex_positions"] = vertices.ravel()
        parameters["faces"] = faces.ravel()
        parameters.update()
        self._scene: Any = mi.load_dict({"type": "scene", "room": shape})

    def cast(
        self, origins: FloatArray, directions: FloatArray
    ) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """First hits of rays with (N, 3) origins and (N, 3) unit directions.

        Returns distance (N,), infinite on a miss, metres, and owner (N,), −1 on a miss.
        """
        import mitsuba as mi

        origins, directions = np.asarray(origins, np.float32), np.asarray(directions, np.float32)
        if mi.variant().startswith("scalar"):
            hits = [
                self._scene.ray_intersect_preliminary(mi.Ray3f(o, d))
                for o, d in zip(origins, directions, strict=True)
            ]
            distance = np.array([h.t for h in hits], np.float32)
            triangle = np.array([h.prim_index for h in hits], np.int64)
        else:
            rays = mi.Ray3f(
                mi.Point3f(np.ascontiguousarray(origins.T)), mi.Vector3f(np.ascontiguousarray(directions.T))
            )
            hit = self._scene.ray_intersect_preliminary(rays, coherent=False)
            distance, triangle = np.array(hit.t), np.array(hit.prim_index).astype(np.int64)
        found = np.isfinite(distance)
        owner = np.where(found, self._owner[np.where(found, triangle, 0)], -1)
        return distance, owner
