"""A room on disk: scene.xml with its meshes and textures, room.glb and room.json.

Stock Mitsuba renders scene.xml without this package, and the renderer here reads the same file, so what is
published is what was rendered.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import numpy as np
from PIL import Image

from gibench.generators.glb import write_glb
from gibench.generators.light import radiance_of
from gibench.generators.light_shapes import LAMP_MATERIAL, light_matrix, light_mesh
from gibench.generators.materials import bsdf_xml, tile_size
from gibench.generators.outside import GROUND, ground_element
from gibench.generators.panorama import write_panorama
from gibench.generators.parts import Camera, Environment, FloatArray, Light, Mesh, Room, Texture
from gibench.rendering.lighting import Lighting
from gibench.rendering.scene import OPENINGS

PANORAMA = "textures/environment.hdr"  # what lies outside the windows


def write_room(
    room: Room,
    folder: str | Path,
    *,
    max_depth: int = 9,
    resolution: tuple[int, int] = (256, 192),
    spp: int = 64,
) -> None:
    """Write a room into a folder, which is made if it does not exist.

    scene.xml, meshes/*.ply, textures/*.png, openings.json, room.glb and room.json. Equal rooms give equal files.
    max_depth (Mitsuba's: 1 shows lamps alone, 2 direct light), resolution (width, height) and spp are those of
    the integrator, films and samplers in scene.xml.
    """
    folder = Path(folder)
    (folder / "meshes").mkdir(parents=True, exist_ok=True)
    (folder / "textures").mkdir(exist_ok=True)
    for thing in room.objects:
        for number, (mesh, material) in enumerate(thing.shapes):
            tile = tile_size(room.materials[material])
            write_ply(mesh, folder / "meshes" / f"{thing.name}.{number}.ply", tile=tile)
    for light in room.lights:
        if light.shape == "shade":
            tile = tile_size(room.materials[light.slot])
            write_ply(light_mesh(light), folder / "meshes" / f"{light.name}.ply", tile=tile)
    for surface in room.materials.values():
        if isinstance(surface.reflectance, Texture):
            image = Image.fromarray(surface.reflectance.pixels)
            image.save(folder / "textures" / f"{surface.name}.png", compress_level=2)
    outside = write_panorama(room.environment, folder, PANORAMA)
    scene = scene_element(room, outside, max_depth=max_depth, resolution=resolution, spp=spp)
    indent(scene, "  ")
    ElementTree(scene).write(folder / "scene.xml", encoding="utf-8", xml_declaration=True)
    write_glb(room, folder)
    (folder / OPENINGS).write_text(json.dumps(room.openings.tolist()) + "\n", encoding="utf-8")
    text = json.dumps(describe(room), indent=1, allow_nan=False)
    (folder / "room.json").write_text(text + "\n", encoding="utf-8")


def write_ply(mesh: Mesh, path: Path, *, tile: tuple[float, float] = (1.0, 1.0)) -> None:
    """Write a mesh as PLY; see `ply_bytes`."""
    path.write_bytes(ply_bytes(mesh, tile=tile))


def ply_bytes(
    mesh: Mesh,
    *,
    tile: tuple[float, float] = (1.0, 1.0),
    vertex_attributes: Mapping[str, FloatArray] | None = None,
    face_attributes: Mapping[str, FloatArray] | None = None,
) -> bytes:
    """A mesh as binary little-endian PLY with float32 positions, normals and UVs, where it has these.

    tile: metres that the texture's tile covers; UVs are divided by it. Scaling them here rather than by a transform
    of each texture keeps materials alike, so that Dr.Jit compiles one kernel for them all, and for the next room.
    vertex_attributes, face_attributes: (N, C) by name; Mitsuba calls them vertex_NAME and face_NAME.
    """
    of_vertices, of_faces = vertex_attributes or {}, face_attributes or {}

    def named(attributes: Mapping[str, FloatArray]) -> list[str]:
        return [f"{name}_{k}" for name, values in attributes.items() for k in range(values.shape[1])]

    columns = {"x y z": mesh.vertices, "nx ny nz": mesh.normals, "u v": mesh.uvs / tile}
    columns = {names: values for names, values in columns.items() if len(values) == len(mesh.vertices)}
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(mesh.vertices)}",
        *(f"property float {name}" for names in columns for name in names.split()),
        *(f"property float {name}" for name in named(of_vertices)),
        f"element face {len(mesh.faces)}",
        "property list uchar int vertex_indices",
        *(f"property float {name}" for name in named(of_faces)),
        "end_header\n",
    ]
    count = sum(values.shape[1] for values in of_faces.values())
    extra = [("attributes", "<f4", count)] if count else []
    faces = np.empty(len(mesh.faces), dtype=[("count", "u1"), ("corners", "<i4", 3), *extra])
    faces["count"], faces["corners"] = 3, mesh.faces
    if count:
        faces["attributes"] = np.concatenate(list(of_faces.values()), 1).reshape(faces["attributes"].shape)
    vertices = np.concatenate([*columns.values(), *of_vertices.values()], 1, dtype="<f4", casting="same_kind")
    return "\n".join(lines).encode("ascii") + vertices.tobytes() + faces.tobytes()


def scene_element(
    room: Room, outside: Element | None, *, max_depth: int, resolution: tuple[int, int], spp: int
) -> Element:
    """The `<scene>` of a room, with file names relative to its folder; outside: its environment emitter.

    See `write_room`.
    """
    scene = Element("scene", version="3.0.0")
    integrator = SubElement(scene, "integrator", type="path")
    SubElement(integrator, "integer", name="max_depth", value=str(max_depth))
    for number, camera in enumerate(room.cameras):
        scene.append(sensor_element(camera, f"camera.{number}", resolution, spp))
    for material in room.materials.values():
        textured = isinstance(material.reflectance, Texture)
        scene.append(bsdf_xml(material, f"textures/{material.name}.png" if textured else None))
    for thing in room.objects:
        for number, (_mesh, material_name) in enumerate(thing.shapes):
            shape = SubElement(scene, "shape", type="ply", id=f"{thing.name}.{number}")
            SubElement(shape, "string", name="filename", value=f"meshes/{thing.name}.{number}.ply")
            SubElement(shape, "ref", id=material_name)
    for light in room.lights:
        scene.append(light_element(light))
    if outside is not None:
        # Lamps outnumber the sky, which would leave it few samples; half of them suit both.
        SubElement(outside, "float", name="sampling_weight", value=str(max(1, len(room.lights))))
        scene.append(outside)
    if GROUND in room.materials:
        scene.append(ground_element())
    return scene


def _number(value: float) -> str:
    return repr(float(value))


def sensor_element(camera: Camera, name: str, resolution: tuple[int, int], spp: int) -> Element:
    """The `<sensor>` of a camera. resolution: (width, height) of its film."""
    sensor = Element("sensor", type="perspective", id=name)
    SubElement(sensor, "string", name="fov_axis", value="x")
    SubElement(sensor, "float", name="fov", value=_number(np.degrees(camera.fov)))
    SubElement(sensor, "float", name="near_clip", value="0.01")
    for axis, share in zip("xy", camera.principal_point, strict=True):
        if share:
            # Mitsuba counts from the principal point to the middle of the film.
            SubElement(sensor, "float", name=f"principal_point_offset_{axis}", value=_number(-share))
    transform = SubElement(sensor, "transform", name="to_world")
    if camera.mirrored:
        SubElement(transform, "scale", x="-1", y="1", z="1")
    up = camera.pinhole.look_at_up
    places = {"origin": camera.position, "target": camera.target, "up": up}
    SubElement(transform, "lookat", {name: ", ".join(map(_number, p)) for name, p in places.items()})
    film = SubElement(sensor, "film", type="hdrfilm")
    SubElement(film, "integer", name="width", value=str(resolution[0]))
    SubElement(film, "integer", name="height", value=str(resolution[1]))
    SubElement(film, "string", name="pixel_format", value="rgb")
    SubElement(film, "string", name="component_format", value="float32")
    SubElement(film, "rfilter", type="box")
    # Mitsuba's stratified samplers are biased for small sample counts.
    sampler = SubElement(sensor, "sampler", type="independent")
    SubElement(sampler, "integer", name="sample_count", value=str(spp))
    return sensor


def light_element(light: Light) -> Element:
    """The `<shape>` of a lamp's light, of the material LAMP_MATERIAL where it has no other."""
    shape = Element("shape", type="ply" if light.shape == "shade" else light.shape, id=light.name)
    if light.shape == "shade":
        SubElement(shape, "string", name="filename", value=f"meshes/{light.name}.ply")
    elif light.shape == "sphere":
        x, y, z = (_number(c) for c in light.centre)
        SubElement(shape, "point", name="center", x=x, y=y, z=z)
        SubElement(shape, "float", name="radius", value=_number(light.size[0]))
    else:
        transform = SubElement(shape, "transform", name="to_world")
        values = " ".join(_number(v) for v in light_matrix(light).ravel())
        SubElement(transform, "matrix", value=values)
    SubElement(shape, "ref", id=light.slot or LAMP_MATERIAL)
    emitter = SubElement(shape, "emitter", type="area")
    SubElement(emitter, "rgb", name="radiance", value=" ".join(_number(c) for c in radiance_of(light)))
    return shape


def describe(room: Room) -> dict[str, Any]:
    """Content of room.json: everything but meshes and pixels, JSON-able, in a fixed order."""
    return {
        "seed": room.seed,
        "index": room.index,
        "kind": room.kind,
        "parameters": _plain(room.parameters),
        "objects": [
            {
                "name": thing.name,
                "family": thing.family,
                "parameters": _plain(thing.parameters),
                "position": _plain(thing.position),
                "yaw": float(thing.yaw),
                "materials": [material for _, material in thing.shapes],
            }
            for thing in room.objects
        ],
        "lights": [
            {
                "name": light.name,
                "shape": light.shape,
                "size": _plain(light.size),
                "centre": _plain(light.centre),
                "direction": _plain(light.direction),
                "lumens": float(light.lumens),
                "kelvin": float(light.kelvin),
            }
            for light in room.lights
        ],
        "environment": {"kind": room.environment.kind, "parameters": _outside(room.environment)},
        "materials": {
            name: {
                "family": material.family,
                "bsdf": material.bsdf,
                "alpha": float(material.alpha),
                "ior": float(material.ior),
                "conductor": material.conductor,
                "parameters": _plain(material.parameters),
            }
            for name, material in room.materials.items()
        },
        "cameras": camera_records(room.cameras),
        **lighting_records(room.lightings),
        "rejections": dict(sorted(room.rejections.items())),
    }


def _outside(environment: Environment) -> Any:
    """Its parameters, a panorama by its name alone: where it lay on this machine is nobody's concern."""
    values = _plain(environment.parameters)
    return {**values, "path": Path(values["path"]).name} if "path" in values else values


def camera_records(cameras: Sequence[Camera]) -> list[dict[str, Any]]:
    """Cameras as room.json holds them."""
    return [
        {
            "position": _plain(camera.position),
            "target": _plain(camera.target),
            "fov": float(camera.fov),
            "path": camera.path,
            "step": int(camera.step),
            **camera.peculiarities,
        }
        for camera in cameras
    ]


def lighting_records(lightings: Sequence[Lighting]) -> dict[str, Any]:
    """Light of each camera as room.json holds it, in the same order; nothing where all have the room's own."""
    return {"lightings": [lighting_record(lighting) for lighting in lightings]} if lightings else {}


def lighting_record(lighting: Lighting) -> dict[str, Any]:
    """A lighting as JSON-able values. An environment is known by its name and the SHA-256 of its pixels."""
    if lighting.area is not None:
        return {"kind": lighting.kind, **asdict(lighting.area)}
    if lighting.environment is not None:
        panorama = lighting.environment.panorama
        rotation = lighting.environment.rotation
        return {
            "kind": lighting.kind,
            "environment": panorama.name,
            "sha256": panorama.sha256,
            "rotation": rotation,
        }
    return {"kind": lighting.kind}


def _plain(value: Any) -> Any:
    """NumPy scalars, arrays, tuples and mappings as the types that JSON knows."""
    if isinstance(value, dict) or hasattr(value, "items"):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        return value.item()
    return value
