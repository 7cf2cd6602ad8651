"""A room as binary glTF 2.0: the same geometry and materials for any glTF viewer.

Mitsuba's materials have no exact counterpart there. Coated surfaces become dielectrics, conductors metals with
their colour at normal incidence, lamps emissive surfaces; the environment is left out.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.generators.light import kelvin_to_rgb
from gibench.generators.light_shapes import light_mesh
from gibench.generators.materials import base_color, tile_size
from gibench.generators.parts import Light, Material, Mesh, Room, Texture

FLOAT, UINT32 = 5126, 5125  # glTF component types
VERTICES, INDICES = 34962, 34963  # glTF buffer targets
Y_UP = [-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]  # quaternion from Z up to glTF's Y up


class GlbDocument:
    """A glTF document that grows by meshes, materials and images."""

    def __init__(self) -> None:
        """An empty one."""
        self.chunks: list[bytes] = []
        self.size = 0
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self.materials: list[dict[str, Any]] = []
        self.images: list[dict[str, Any]] = []

    def view(self, data: bytes, target: int | None = None) -> int:
        """Append bytes to the buffer and return the number of their view."""
        view: dict[str, Any] = {"buffer": 0, "byteOffset": self.size, "byteLength": len(data)}
        if target is not None:
            view["target"] = target
        self.views.append(view)
        padding = -len(data) % 4
        self.chunks.append(data + bytes(padding))
        self.size += len(data) + padding
        return len(self.views) - 1

    def accessor(self, values: NDArray[Any], kind: str, *, limits: bool = False) -> int:
        """Append an array, float32 for vertices and uint32 for indices, and return its accessor."""
        indices = kind == "SCALAR"
        values = np.ascontiguousarray(values, dtype="<u4" if indices else "<f4")
        entry: dict[str, Any] = {
            "bufferView": self.view(values.tobytes(), INDICES if indices else VERTICES),
            "componentType": UINT32 if indices else FLOAT,
            "count": len(values),
            "type": kind,
        }
        if limits:
            entry["min"], entry["max"] = values.min(0).tolist(), values.max(0).tolist()
        self.accessors.append(entry)
        return len(self.accessors) - 1

    def image(self, content: bytes, mime: str) -> int:
        """Append a PNG or JPEG and return the number of the texture that shows it."""
        self.images.append({"bufferView": self.view(content), "mimeType": mime})
        return len(self.images) - 1

    def primitive(self, mesh: Mesh, tile: tuple[float, float], material: int) -> dict[str, Any]:
        """One mesh with its metric UVs divided by what a tile of its texture covers, metres."""
        return {
            "attributes": {
                "POSITION": self.accessor(mesh.vertices, "VEC3", limits=True),
                "NORMAL": self.accessor(mesh.normals, "VEC3"),
                "TEXCOORD_0": self.accessor(mesh.uvs / tile, "VEC2"),
            },
            "indices": self.accessor(mesh.faces.ravel(), "SCALAR"),
            "material": material,
        }

    def save(self, path: Path, things: Mapping[str, list[dict[str, Any]]]) -> None:
        """Write the file. things: name → primitives."""
        count = len(things)
        gltf = {
            "asset": {"version": "2.0", "generator": "gibench"},
            "scene": 0,
            "scenes": [{"nodes": [count]}],
            "nodes": [
                *({"name": name, "mesh": number} for number, name in enumerate(things)),
                {"name": "room", "rotation": Y_UP, "children": list(range(count))},
            ],
            "meshes": [{"name": n, "primitives": p} for n, p in things.items()],
            "materials": self.materials,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": self.size}],
        }
        if self.images:
            gltf["images"] = self.images
            gltf["samplers"] = [{"wrapS": 10497, "wrapT": 10497}]
            gltf["textures"] = [{"source": i, "sampler": 0} for i in range(len(self.images))]
        text = json.dumps(gltf, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        with path.open("wb") as file:
            file.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + self.size))
            file.write(struct.pack("<I4s", len(text), b"JSON") + text)
            file.write(struct.pack("<I4s", self.size, b"BIN\0"))
            file.writelines(self.chunks)


def write_glb(room: Room, folder: Path) -> None:
    """Write room.glb into a folder whose textures/ already holds the PNGs of the room's materials."""
    document = GlbDocument()
    numbers: dict[str, int] = {}
    for name, material in room.materials.items():
        numbers[name] = len(document.materials)
        document.materials.append(_material(document, material, folder))
    meshes, names = [], []
    for thing in room.objects:
        meshes.append(
            [
                document.primitive(mesh, tile_size(room.materials[name]), numbers[name])
                for mesh, name in thing.shapes
            ]
        )
        names.append(thing.name)
    for light in room.lights:
        document.materials.append(_emissive(light))
        meshes.append([document.primitive(light_mesh(light), (1.0, 1.0), len(document.materials) - 1)])
        names.append(light.name)
    document.save(folder / "room.glb", dict(zip(names, meshes, strict=True)))


def _material(document: GlbDocument, material: Material, folder: Path) -> dict[str, Any]:
    metal = material.bsdf in ("conductor", "roughconductor")
    surface: dict[str, Any] = {
        "metallicFactor": 1.0 if metal else 0.0,
        # glTF's roughness is the square root of the GGX alpha.
        "roughnessFactor": 1.0 if material.bsdf == "diffuse" else math.sqrt(material.alpha),
    }
    if isinstance(material.reflectance, Texture):
        png = (folder / "textures" / f"{material.name}.png").read_bytes()
        surface["baseColorTexture"] = {"index": document.image(png, "image/png")}
    else:
        surface["baseColorFactor"] = [*(min(1.0, c) for c in base_color(material)), 1.0]
    return {"name": material.name, "pbrMetallicRoughness": surface, "doubleSided": True}


def _emissive(light: Light) -> dict[str, Any]:
    color = np.array(kelvin_to_rgb(light.kelvin))
    return {
        "name": light.name,
        "pbrMetallicRoughness": {"baseColorFactor": [0.0, 0.0, 0.0, 1.0], "metallicFactor": 0.0},
        "emissiveFactor": (color / color.max()).tolist(),
    }
