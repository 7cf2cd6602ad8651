"""OBJ files of several materials, and of normals without length, as PLY meshes of one material each.

Mitsuba 0.x gave each group of an OBJ file the material of its name (`usemtl`), from the scene or from the .mtl file
beside it; Mitsuba 3 has one material a mesh.
"""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gibench.generators.imported import locating
from gibench.generators.imported.changes import Note
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.reading import SceneTree
from gibench.generators.imported.tree import Node, copied, new, parents_of
from gibench.generators.imported.upgrading.rules import rgb, setting
from gibench.generators.imported.upgrading.surfaces import lobes
from gibench.generators.parts import FloatArray, Mesh
from gibench.generators.scene_files import ply_bytes

ZERO_NORMAL = re.compile(rb"^[ \t]*vn(?:[ \t]+[-+]?0*\.?0*(?:[eE][-+]?\d+)?){3}[ \t]*\r?$", re.M)

MOST_MTL_BYTES = 1 << 24


def split_objs(tree: SceneTree, note: Note) -> None:
    """Make meshes of OBJ files that Mitsuba 3 would refuse or colour otherwise, in place."""
    parents = parents_of(tree.root)
    for node in [n for n in tree.root.everything() if n.tag == "shape" and n.type == "obj"]:
        name = node.property("filename")
        if name is None:
            continue
        path = tree.located(name.get("value", ""), name.where)
        if not path.is_file():
            continue
        content = path.read_bytes()
        materials = _materials(tree, node, path, content, note) if node.legacy else {}
        if not materials and not ZERO_NORMAL.search(content):
            continue
        groups = read_obj(path, node.where, flip=node.value("flip_tex_coords", "true") != "false")
        if not materials:
            groups = {"": merged_groups(groups)}
            note(node, f"normals without length in {path.name} are those of the faces around them")
        parent = parents[id(node)]
        at = list(parent).index(node)
        parent[at : at + 1] = [
            _shape(tree, node, path, group, mesh, materials) for group, mesh in groups.items()
        ]


def _shape(
    tree: SceneTree, node: Node, path: Path, group: str, mesh: Mesh, materials: dict[str, Node]
) -> Node:
    shape = copied(node)
    shape.set("type", "ply")
    gone = ("filename", "flip_tex_coords")
    kept = [part for part in shape.nodes() if part.get("name") not in gone]
    if materials:
        kept = [part for part in kept if part.tag not in ("bsdf", "ref")]
        if (material := materials.get(group, materials.get(""))) is not None:
            kept.append(copied(material))
        if group and shape.get("id"):
            shape.set("id", f"{shape.get('id')}.{group}")
    made = tree.make(f"{path.stem}.{group}" if group else path.stem, ".ply", ply_bytes(mesh))
    shape[:] = [new("string", node, name="filename", value=made), *kept]
    return shape


def _materials(tree: SceneTree, node: Node, path: Path, content: bytes, note: Note) -> dict[str, Node]:
    """The material of each group, by its name; "" for all others. None where one material is for all of it."""
    own = [part for part in node.nodes("bsdf", "ref") if _is_material(tree, part)]
    used = re.findall(rb"^[ \t]*usemtl[ \t]+(.*?)[ \t]*\r?$", content, re.M)
    if len(own) > 1:
        named = {part.get("name", ""): part for part in own}
        for part in own:
            part.attrib.pop("name", None)
        # Each is known by its name once; those without take what no other does.
        note(node, f"{path.name} is a mesh for each of its materials")
        return named
    library = re.search(rb"^[ \t]*mtllib[ \t]+(.*?)[ \t]*\r?$", content, re.M)
    if own or library is None or not used:
        return {}
    name = library[1].decode("utf-8", "replace")
    try:
        mtl = locating.located(name, node.where, (tree.folder, path.parent), allow_outside=tree.allow_outside)
    except SceneFileError as problem:
        raise SceneFileError(f"{problem} (mtllib of {path.name})") from None
    if not mtl.is_file() or mtl.stat().st_size > MOST_MTL_BYTES:
        note(node, f"the materials of {path.name} are missing ({name}): it is grey", loss=True)
        return {}
    materials = read_mtl(tree, mtl, node)
    note(node, f"{path.name} has its materials from {mtl.name}", loss=True)
    return {group: material for group, material in materials.items() if group.encode() in used}


def _is_material(tree: SceneTree, part: Node) -> bool:
    if part.tag == "bsdf":
        return True
    return any(n.tag == "bsdf" and n.get("id") == part.get("id") for n in tree.root.everything())


@dataclass
class _Group:
    corners: list[tuple[int, int, int]] = field(default_factory=list)


def read_obj(path: Path, where: str, *, flip: bool = True) -> dict[str, Mesh]:
    """Meshes of an OBJ file by the material of their faces (`usemtl`), "" before the first.

    Polygons become fans. flip: v grows upwards in the file, and downwards in Mitsuba. Normals without length become the
    mean of the faces around the vertex, by area. Raises SceneFileError with the line of what is wrong.
    """
    columns: dict[str, list[list[float]]] = {"v": [], "vt": [], "vn": []}
    groups: dict[str, _Group] = {}
    current = ""
    for number, line in enumerate(path.read_bytes().decode("latin-1").splitlines(), 1):
        words = line.split()
        if not words:
            continue
        try:
            if words[0] in columns:
                columns[words[0]].append([float(word) for word in words[1 : 3 if words[0] == "vt" else 4]])
            elif words[0] == "usemtl":
                current = line.strip()[6:].strip().encode("latin-1").decode("utf-8", "replace")
            elif words[0] == "f":
                corners = [_corner(word, columns) for word in words[1:]]
                group = groups.setdefault(current, _Group())
                for second, third in itertools.pairwise(corners[1:]):
                    group.corners += [corners[0], second, third]
        except (ValueError, IndexError):
            raise SceneFileError(
                f"{where}: {path.name}:{number}: '{line.strip()[:60]}' cannot be read: it is no number, or names a "
                "vertex that is not there (counted from 1, not from the end)"
            ) from None
    arrays = {
        name: np.array([row + [0.0] * (width - len(row)) for row in columns[name]]).reshape(-1, width)
        for name, width in (("v", 3), ("vt", 2), ("vn", 3))
    }
    if flip and len(arrays["vt"]):
        arrays["vt"][:, 1] = 1 - arrays["vt"][:, 1]
    return {name: _mesh(arrays, group.corners) for name, group in groups.items()}


def merged_groups(groups: dict[str, Mesh]) -> Mesh:
    """One mesh of several."""
    meshes = list(groups.values())
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    has_normals = all(len(mesh.normals) == len(mesh.vertices) for mesh in meshes)
    has_uvs = all(len(mesh.uvs) == len(mesh.vertices) for mesh in meshes)
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]).astype(
            np.int32
        ),
        np.concatenate([mesh.normals for mesh in meshes]) if has_normals else np.zeros((0, 3)),
        np.concatenate([mesh.uvs for mesh in meshes]) if has_uvs else np.zeros((0, 2)),
    )


def _corner(word: str, columns: dict[str, list[list[float]]]) -> tuple[int, int, int]:
    parts = [*word.split("/"), "", ""][:3]
    numbers = [int(part) if part else 0 for part in parts]
    for value, name in zip(numbers, ("v", "vt", "vn"), strict=True):
        if value < 0 or value > len(columns[name]):
            raise IndexError(value)
    if numbers[0] == 0:
        raise IndexError(0)
    return numbers[0] - 1, numbers[1] - 1, numbers[2] - 1


def _mesh(arrays: dict[str, FloatArray], corners: list[tuple[int, int, int]]) -> Mesh:
    rows, inverse = np.unique(np.array(corners, dtype=np.int64).reshape(-1, 3), axis=0, return_inverse=True)
    faces = inverse.reshape(-1, 3).astype(np.int32)
    vertices = arrays["v"][rows[:, 0]]
    uvs = arrays["vt"][rows[:, 1]] if (rows[:, 1] >= 0).all() else np.zeros((0, 2))
    if not len(rows) or not (rows[:, 2] >= 0).all():
        return Mesh(vertices, faces, np.zeros((0, 3)), uvs)
    normals = arrays["vn"][rows[:, 2]]
    zero = ~(np.linalg.norm(normals, axis=1) > 0)
    if zero.any():
        place = np.unique(vertices, axis=0, return_inverse=True)[1].reshape(-1)
        a, b, c = (vertices[faces[:, k]] for k in range(3))
        across = np.cross(b - a, c - a)
        around = np.zeros((place.max() + 1, 3))
        for k in range(3):
            np.add.at(around, place[faces[:, k]], across)
        normals[zero] = around[place[zero]]
        normals[~(np.linalg.norm(normals, axis=1) > 0)] = (0.0, 0.0, 1.0)
    return Mesh(vertices, faces, normals, uvs)


def read_mtl(tree: SceneTree, path: Path, like: Node) -> dict[str, Node]:
    """Materials of an .mtl file by name: diffuse, with a glossy lobe where Ks and Ns say so. Raises SceneFileError."""
    values: dict[str, dict[str, str]] = {}
    current: dict[str, str] = {}
    for line in path.read_bytes().decode("utf-8", "replace").splitlines():
        words = line.strip().split(None, 1)
        if len(words) == 2 and not words[0].startswith("#"):
            if words[0] == "newmtl":
                current = values.setdefault(words[1].strip(), {})
            else:
                current[words[0].lower()] = words[1].strip()
    return {name: _material(tree, path, like, found) for name, found in values.items()}


def _material(tree: SceneTree, path: Path, like: Node, values: dict[str, str]) -> Node:
    diffuse = _texture(tree, path, like, values["map_kd"]) if "map_kd" in values else None
    if diffuse is None:
        diffuse = rgb(like, "reflectance", _triple(path, like, values.get("kd", "0.5 0.5 0.5")))
    specular = _triple(path, like, values.get("ks", "0 0 0"))
    exponent = _triple(path, like, values.get("ns", "0"))[0]
    bsdf = new("bsdf", like, type="diffuse")
    if max(specular) > 0 and exponent > 0 and values.get("illum", "2") not in ("0", "1"):
        diffuse.set("name", "diffuse_reflectance")
        bsdf[:] = [diffuse, rgb(like, "specular_reflectance", specular)]
        alpha = math.sqrt(2 / (exponent + 2))
        lobes(bsdf, alpha, alpha)
    else:
        bsdf.append(diffuse)
    opacity = _triple(path, like, values.get("d", "1"))[0]
    if opacity < 1:
        mask = new("bsdf", like, type="mask")
        mask[:] = [setting(like, "float", "opacity", repr(max(opacity, 0.0))), bsdf]
        return mask
    return bsdf


def _texture(tree: SceneTree, path: Path, like: Node, text: str) -> Node | None:
    words = text.split()
    if not words or words[0].startswith("-"):  # options, such as -s 2 2, have no counterpart
        words = words[-1:]
    name = " ".join(words)
    where = f"{like.where}: {path.name}"
    image = locating.located(name, where, (tree.folder, path.parent), allow_outside=tree.allow_outside)
    texture = new("texture", like, type="bitmap", name="reflectance")
    texture.append(setting(like, "string", "filename", str(image.resolve() if image.is_file() else name)))
    return texture


def _triple(path: Path, like: Node, text: str) -> tuple[float, float, float]:
    try:
        numbers = [float(word) for word in text.split()]
        if len(numbers) not in (1, 3) or not np.isfinite(numbers).all():
            raise ValueError
    except ValueError:
        raise SceneFileError(
            f"{like.where}: {path.name}: '{text[:40]}' is no colour: write three numbers"
        ) from None
    return (numbers[0], numbers[-2] if len(numbers) == 3 else numbers[0], numbers[-1])
