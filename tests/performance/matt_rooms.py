"""Matt copies of rooms: triangles of one colour each, which any renderer reads alike."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from gibench.generators.light_shapes import light_matrix, light_mesh
from gibench.generators.parts import Light, Mesh
from gibench.generators.scene_files import write_ply
from gibench.rendering import flags, surface
from gibench.rendering.scene import load_dict

DARKEST, BRIGHTEST = 0.05, 0.8
"""Reflectances of a matt copy."""

POINTS = 1024
"""Of a shape, over which its albedo is averaged."""

NO_NORMALS, NO_UVS = np.zeros((0, 3)), np.zeros((0, 2))


@dataclass(frozen=True, eq=False)
class MattShape:
    """A mesh of flat triangles. reflectance: (3,), of both sides. radiance: (3,), of the front, or None.

    light: what the mesh is made of, where that is a lamp's light.
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    reflectance: np.ndarray
    radiance: np.ndarray | None
    light: Light | None


@dataclass(frozen=True, eq=False)
class MattRoom:
    """shapes, and the panorama that Mitsuba has around them, with its share of the light samples, or None."""

    shapes: list[MattShape]
    environment: Any = None


def matt_room(room, scene) -> MattRoom:
    """room: as generated. scene: the same as loaded from its files."""
    lights = {light.name: light for light in room.lights}
    shapes = []
    for shape in sorted(scene.mi_scene.shapes(), key=lambda s: s.id()):
        if shape.is_mesh():
            corners = dr.arange(mi.UInt32, shape.vertex_count())
            vertices = np.array(shape.vertex_position(corners)).T
            faces = np.array(shape.face_indices(dr.arange(mi.UInt32, shape.face_count()))).T
        else:
            mesh = light_mesh(lights[shape.id()])
            vertices, faces = mesh.vertices, mesh.faces
        radiance = None
        if shape.is_emitter():
            radiance = np.array(mi.traverse(shape.emitter())["radiance.value"], dtype=float).ravel()
        reflectance, light = _reflectance(scene, shape), lights.get(shape.id())
        shapes.append(MattShape(shape.id(), vertices, faces, reflectance, radiance, light))
    return MattRoom(shapes, scene.mi_scene.environment())


def _reflectance(scene, shape):
    """Mean of what it reflects, glossily or not."""
    assert not shape.bsdf().flags() & flags.TRANSMITS, f"{shape.id()} lets light through"
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, POINTS)
    si = mi.SurfaceInteraction3f(shape.sample_position(0.0, sampler.next_2d()), [])
    si.wi, si.shape = mi.Vector3f(0, 0, 1), mi.ShapePtr(shape)
    bsdf, valid = mi.BSDFPtr(shape.bsdf()), mi.Bool(True)
    albedo = surface.albedo(scene, bsdf, si, valid) + surface.specular_albedo(scene, bsdf, si, valid)
    return np.clip(np.array(albedo).reshape(3, -1).mean(axis=1), DARKEST, BRIGHTEST)


def mitsuba_scene(matt: MattRoom, openings, folder: Path):
    """`Scene` of a matt room. Its meshes are written to the folder."""
    description: dict[str, Any] = {"type": "scene"}
    folder.mkdir(parents=True)
    for number, shape in enumerate(matt.shapes):
        write_ply(Mesh(shape.vertices, shape.faces, NO_NORMALS, NO_UVS), folder / f"{number}.ply")
        description[f"shape_{number}"] = {
            "type": "ply",
            "id": shape.name,
            "filename": str(folder / f"{number}.ply"),
            "face_normals": True,
            "bsdf": {
                "type": "twosided",
                "id": f"{shape.name}.matt",
                "nested": {"type": "diffuse", "reflectance": _rgb(shape.reflectance)},
            },
        }
        if shape.radiance is not None:
            emitter = {"type": "area", "radiance": _rgb(shape.radiance)}
            description[f"shape_{number}"]["emitter"] = emitter
    if matt.environment is not None:
        description["environment"] = matt.environment
    return replace(load_dict(description), openings=openings)


def _rgb(value):
    return {"type": "rgb", "value": [float(c) for c in value]}


def panorama(environment, height: int = 512) -> np.ndarray:
    """(height, 2 · height, 3) radiance by directions around Z; its first row is up, its middle column is +X, and
    columns to the right of it turn towards −Y."""
    azimuth = np.pi - (np.arange(2 * height) + 0.5) * np.pi / height
    elevation = np.pi / 2 - (np.arange(height) + 0.5) * np.pi / height
    across, up = (values.ravel() for values in np.meshgrid(azimuth, elevation))
    directions = [np.cos(up) * np.cos(across), np.cos(up) * np.sin(across), np.sin(up)]
    si = dr.zeros(mi.SurfaceInteraction3f, len(up))
    si.wi = -mi.Vector3f(*(mi.Float(values.astype(np.float32)) for values in directions))
    return np.array(environment.eval(si)).T.reshape(height, 2 * height, 3)


def save(matt: MattRoom, camera, openings, path: Path) -> None:
    """A matt room, a camera and the openings as `cycles_frames` reads them: .npz."""
    count = len(matt.shapes)
    arrays: dict[str, np.ndarray] = {
        "position": np.array(camera.position),
        "frame": camera.frame,
        "fov": np.array(camera.fov),
        "openings": np.zeros((0, 3, 3)) if openings is None else openings,
        "reflectances": np.array([shape.reflectance for shape in matt.shapes]),
        "radiances": np.array([np.zeros(3) if s.radiance is None else s.radiance for s in matt.shapes]),
        "flat_lights": np.array(["" for _ in range(count)], dtype="U16"),
        "matrices": np.tile(np.eye(4), (count, 1, 1)),
    }
    for number, shape in enumerate(matt.shapes):
        arrays[f"vertices_{number}"], arrays[f"faces_{number}"] = shape.vertices, shape.faces
        if shape.light is not None and shape.light.shape in ("disk", "rectangle"):
            arrays["flat_lights"][number] = shape.light.shape
            arrays["matrices"][number] = light_matrix(shape.light)
    if matt.environment is not None:
        arrays["panorama"] = panorama(matt.environment)
    np.savez(path, **arrays)
