"""An imported scene as binary glTF 2.0, for any viewer: its meshes, and the nearest that glTF has to its materials."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np

from gibench.generators.glb import GlbDocument
from gibench.generators.imported.images import as_png
from gibench.generators.imported.scene import ImportedScene
from gibench.generators.imported.tree import Node

MIMES = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg"}
"""Of the images that glTF may hold, by their first bytes; others are converted."""

COLORS = ("reflectance", "diffuse_reflectance", "base_color", "specular_reflectance")
GREY = (0.5, 0.5, 0.5)


def write_scene_glb(scene: ImportedScene, path: Path) -> None:
    """Write a GLB file of all meshes of a scene; shapes that are no meshes, and the environment, are left out."""
    document = GlbDocument()
    by_id = {node.get("id", ""): node for node in scene.tree.root.everything() if node.tag != "ref"}
    images: dict[Path | str, int] = {}
    numbers: dict[int, int] = {}
    things: dict[str, list[dict[str, Any]]] = {}
    for shape in sorted(scene.loaded.mi_scene.shapes(), key=lambda s: s.id()):
        if not shape.is_mesh() or shape.face_count() == 0:
            continue
        node = by_id[shape.id()]
        bsdf = next(iter(node.nodes("bsdf")), None)
        for ref in node.nodes("ref"):
            if (target := by_id.get(ref.get("id", ""))) is not None and target.tag == "bsdf":
                bsdf = target
        emits = bool(node.nodes("emitter"))
        key = -id(node) if emits else id(bsdf)
        if key not in numbers:
            numbers[key] = len(document.materials)
            document.materials.append(_material(document, scene, by_id, images, bsdf, emits))
        things[shape.id()] = [_primitive(document, shape, numbers[key])]
    document.save(path, things)


def _primitive(document: GlbDocument, shape: Any, material: int) -> dict[str, Any]:
    def buffer(values: Any, width: int, dtype: type = np.float32) -> Any:
        return np.array(values, dtype=dtype).reshape(-1, width)

    attributes = {
        "POSITION": document.accessor(buffer(shape.vertex_positions_buffer(), 3), "VEC3", limits=True)
    }
    if shape.has_vertex_normals():
        normals = buffer(shape.vertex_normals_buffer(), 3)
        # glTF wants unit vectors; what has no direction gets one.
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        unit = np.where(length > 0, normals / np.where(length > 0, length, 1), [[0, 0, 1]])
        attributes["NORMAL"] = document.accessor(unit, "VEC3")
    if shape.has_vertex_texcoords():
        attributes["TEXCOORD_0"] = document.accessor(buffer(shape.vertex_texcoords_buffer(), 2), "VEC2")
    faces = buffer(shape.faces_buffer(), 3, np.uint32)
    return {
        "attributes": attributes,
        "indices": document.accessor(faces.ravel(), "SCALAR"),
        "material": material,
    }


def _material(
    document: GlbDocument,
    scene: ImportedScene,
    by_id: dict[str, Node],
    images: dict[Path | str, int],
    bsdf: Node | None,
    emits: bool,
) -> dict[str, Any]:
    parts = [] if bsdf is None else list(bsdf.everything())
    surface: dict[str, Any] = {
        "metallicFactor": 1.0 if any(part.type in ("conductor", "roughconductor") for part in parts) else 0.0,
        "roughnessFactor": 1.0,
        "baseColorFactor": [*(GREY if bsdf is not None else (0.8, 0.8, 0.8)), 1.0],
    }
    for part in parts:
        if part.get("name") in ("alpha", "alpha_u") and part.tag == "float":
            surface["roughnessFactor"] = min(1.0, math.sqrt(max(0.0, float(part.get("value", "1")))))
        elif part.type in ("conductor", "plastic"):
            surface["roughnessFactor"] = 0.0
        elif part.type == "principled":
            # glTF's own words, and glTF's own roughness: the root of alpha.
            surface["metallicFactor"] = _factor(part, "metallic", 0.0)
            surface["roughnessFactor"] = _factor(part, "roughness", 0.5)
    material: dict[str, Any] = {
        "name": "" if bsdf is None else bsdf.get("id", ""),
        "pbrMetallicRoughness": surface,
        "doubleSided": True,
    }
    for color in (part for part in parts if part.get("name") in COLORS):
        color = by_id.get(color.get("id", ""), color) if color.tag == "ref" else color
        texture = _texture(document, scene, images, color)
        constant = _constant(color)
        if texture is not None:
            surface["baseColorTexture"] = {"index": texture}
            surface["baseColorFactor"] = [1.0, 1.0, 1.0, 1.0]
        elif constant is not None:
            surface["baseColorFactor"] = [*constant, 1.0]
        break
    if emits:
        material["emissiveFactor"] = [1.0, 1.0, 1.0]
    return material


def _factor(bsdf: Node, name: str, default: float) -> float:
    """A constant property of a material in [0, 1]; the mean of glTF's range where it is a texture."""
    part = bsdf.property(name)
    constant = (default,) if part is None else _constant(part)
    return 0.5 if constant is None else sum(constant) / len(constant)


def _constant(color: Node) -> tuple[float, ...] | None:
    words = re.split(r"[\s,]+", color.get("value", "").strip())
    if color.tag not in ("rgb", "float") or len(words) not in (1, 3):
        return None
    values = [min(1.0, max(0.0, float(word))) for word in words]
    return tuple(values * 3 if len(values) == 1 else values)


def _texture(
    document: GlbDocument, scene: ImportedScene, images: dict[Path | str, int], color: Node
) -> int | None:
    name = color.property("filename")
    if color.tag != "texture" or color.type != "bitmap" or name is None:
        return None
    path = scene.tree.source(name.get("value", ""), name.where)
    if path not in images:
        content = scene.tree.content(path)
        mime = next((mime for start, mime in MIMES.items() if content.startswith(start)), None)
        if mime is None:
            content, mime = as_png(content), "image/png"
        images[path] = document.image(content, mime)
    return images[path]
