"""Small scenes made of meshes, which alone can carry a lightmap; metres."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from gibench.generators.glb import Y_UP
from tests.rendering import scenes


def diffuse(*reflectance: float) -> dict[str, Any]:
    return scenes.two_sided(type="diffuse", reflectance=scenes.rgb(*reflectance))


def slab(low: list[float], high: list[float], bsdf: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A closed box between two corners."""
    import mitsuba as mi

    centre = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
    half = [(b - a) / 2 for a, b in zip(low, high, strict=True)]
    place = mi.ScalarTransform4f().translate(centre) @ mi.ScalarTransform4f().scale(half)
    return {"type": "cube", "to_world": place, "bsdf": bsdf, **more}


def room(
    bsdf: dict[str, Any], half: float = 1.0, thick: float = 0.1, prefix: str = "", **more: Any
) -> dict[str, Any]:
    """Six slabs around a hollow cube at the origin, overlapping at its edges as walls of rooms do."""
    walls = {}
    for axis in range(3):
        for side in (-1, 1):
            low, high = [-half - thick] * 3, [half + thick] * 3
            low[axis], high[axis] = sorted((side * half, side * (half + thick)))
            name = f"{prefix}wall{'xyz'[axis]}{'+' if side > 0 else '-'}"
            walls[name] = slab(low, high, bsdf, **more)
    return walls


def ply(mesh: trimesh.Trimesh, path: Path, bsdf: dict[str, Any], **more: Any) -> dict[str, Any]:
    mesh.export(path)
    return {"type": "ply", "filename": str(path), "bsdf": bsdf, **more}


def write_glb(folder: Path, parts: list[trimesh.Trimesh]) -> None:
    """The room.glb of a folder, of parts in world space with Z up."""
    scene = trimesh.Scene()
    turn = trimesh.transformations.quaternion_matrix([Y_UP[3], *Y_UP[:3]])
    for part in parts:
        scene.add_geometry(part, transform=turn)
    scene.export(folder / "room.glb")


def directions(count: int, seed: int = 0) -> Any:
    """Unit vectors, (count, 3), evenly over the sphere."""
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def looked_up(lightmap: Any, scene: Any, origins: Any, towards: Any) -> tuple[Any, Any, Any]:
    """Where rays end, (N, 3), and what the lightmap says there: `irradiance` and `diffuse`, (N, 3) each."""
    import mitsuba as mi

    ray = mi.Ray3f(
        mi.Point3f(np.ascontiguousarray(np.asarray(origins, dtype=np.float32).T)),
        mi.Vector3f(np.ascontiguousarray(np.asarray(towards, dtype=np.float32).T)),
    )
    preliminary = scene.mi_scene.ray_intersect_preliminary(ray)
    si = preliminary.compute_surface_interaction(ray)
    values = (si.p, lightmap.irradiance(si, preliminary), lightmap.diffuse(si, preliminary))
    points, irradiance, radiance = (np.array(value).T for value in values)
    return points, irradiance, radiance
