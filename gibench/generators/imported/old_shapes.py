"""Height fields and hair of Mitsuba 0.x, which Mitsuba 3 has not: as a mesh, and as curves."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gibench.generators.imported.changes import Note
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.images import linear
from gibench.generators.imported.reading import SceneTree
from gibench.generators.imported.tree import Node, new
from gibench.generators.imported.upgrading.rules import constant_color, number
from gibench.generators.imported.upgrading.textures import FACTOR
from gibench.generators.parts import Mesh
from gibench.generators.scene_files import ply_bytes

MOST_HEIGHTS = 1 << 22
"""Of a height field, which is a vertex each."""

MOST_HAIR_POINTS = 10_000_000

HAIR_RADIUS = 0.025
"""Where a scene gives none, as in Mitsuba 0.6."""

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def mesh_height_fields(tree: SceneTree, note: Note) -> None:
    """Turn every `heightfield` into a mesh over [-1, 1]², in place. Raises SceneFileError."""
    for node in list(tree.root.everything()):
        if node.tag != "shape" or node.type != "heightfield":
            continue
        heights, name = _heights(tree, node)
        scale = number(node, node.value("scale", "1"))
        smooth = node.value("shading_normals", "true").strip() != "false"
        made = tree.make(Path(name).stem, ".ply", ply_bytes(height_mesh(scale * heights, smooth=smooth)))
        note(node, f"the height field {name} is a mesh", loss=True)
        kept = [part for part in node.nodes() if part.get("name") in ("to_world", "flip_normals")]
        kept += [part for part in node.nodes("bsdf", "ref", "emitter") if part not in kept]
        node.set("type", "ply")
        node[:] = [
            new("string", node, name="filename", value=made),
            new("boolean", node, name="face_normals", value="false" if smooth else "true"),
            *kept,
        ]


def _heights(tree: SceneTree, node: Node) -> tuple[NDArray[np.float64], str]:
    """(H, W) of luminance, row 0 on top, and the name of the image."""
    texture = next(iter(node.nodes("texture")), None)
    owner = node if texture is None else texture
    name = owner.property("filename")
    if name is None or (texture is not None and texture.type != "bitmap"):
        kind = "nothing" if texture is None else f"a texture of the type {texture.type}"
        raise SceneFileError(f"{node.where}: the heights of a heightfield come from {kind}: give an image")
    path = tree.located(name.get("value", ""), name.where)
    image = linear(path, raw=owner.value("raw") == "true")
    if image is None:
        raise SceneFileError(f"{name.where}: {path.name} cannot be read as an image: get it again")
    if not 4 <= image.shape[0] * image.shape[1] <= MOST_HEIGHTS or min(image.shape[:2]) < 2:
        raise SceneFileError(
            f"{name.where}: {path.name} has {image.shape[1]} × {image.shape[0]} heights; allowed are 2 × 2 to "
            f"{MOST_HEIGHTS} in all"
        )
    factor = constant_color(owner.property(FACTOR), 1.0) or (1.0, 1.0, 1.0)
    heights = image.astype(np.float64) @ (LUMINANCE * factor)
    if not np.isfinite(heights).all():
        raise SceneFileError(f"{name.where}: heights of {path.name} are not finite: mend the file")
    return heights, path.name


def height_mesh(heights: NDArray[np.float64], *, smooth: bool) -> Mesh:
    """A mesh over [-1, 1]² of heights (H, W) along z, row 0 at y = -1; it faces +z, as in Mitsuba 0.6.

    smooth: with vertex normals.
    """
    rows, columns = heights.shape
    v, u = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
    vertices = np.stack([2 * u - 1, 2 * v - 1, heights], axis=-1).reshape(-1, 3)
    row, column = (index.ravel() for index in np.indices((rows - 1, columns - 1)))
    a = row * columns + column
    b, c, d = a + 1, a + columns, a + columns + 1
    faces = np.concatenate([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)]).astype(np.int32)
    normals = np.zeros((0, 3))
    if smooth:
        down, along = np.gradient(heights, 2 / (rows - 1), 2 / (columns - 1))
        normals = np.stack([-along, -down, np.ones_like(heights)], axis=-1).reshape(-1, 3)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(vertices, faces, normals, np.stack([u, v], axis=-1).reshape(-1, 2))


def curve_hair(tree: SceneTree, note: Note) -> None:
    """Turn every `hair` shape into a `linearcurve`, in place. Raises SceneFileError."""
    for node in list(tree.root.everything()):
        name = node.property("filename")
        if node.tag != "shape" or node.type != "hair" or name is None:
            continue
        path = tree.located(name.get("value", ""), name.where)
        radius = number(node, node.value("radius", repr(HAIR_RADIUS)))
        if radius <= 0:
            raise SceneFileError(f"{node.where}: hair has a radius of {radius:g}: give one above 0")
        strands = _strands(path, name.where)
        text = "\n".join(
            "".join(f"{x:.9g} {y:.9g} {z:.9g} {radius:.9g}\n" for x, y, z in strand.tolist())
            for strand in strands
        )
        thinned = number(node, node.value("reduction", "0"))
        note(node, f"the hair {path.name} is {len(strands)} curves", loss=thinned != 0)
        kept = [part for part in node.nodes() if part.get("name") == "to_world"]
        kept += [part for part in node.nodes("bsdf", "ref", "emitter") if part not in kept]
        node.set("type", "linearcurve")
        node[:] = [
            new("string", node, name="filename", value=tree.make(path.stem, ".txt", text.encode())),
            *kept,
        ]


def _strands(path: Path, where: str) -> list[NDArray[np.float64]]:
    """Points (N, 3) of every hair of two points or more."""
    damaged = SceneFileError(f"{where}: {path.name} is no file of hair (x y z a line, or BINARY_HAIR)")
    if path.stat().st_size > 64 * MOST_HAIR_POINTS:
        raise SceneFileError(f"{where}: {path.name} has more than {MOST_HAIR_POINTS} points: thin it out")
    content = path.read_bytes()
    if content.startswith(b"BINARY_HAIR"):
        points, starts = _binary_hair(content, damaged)
    else:
        points, starts = _ascii_hair(content)
    if not np.isfinite(points).all():
        raise damaged
    strands = [strand for strand in np.split(points, starts) if len(strand) >= 2]
    if not strands:
        raise damaged
    return strands


def _binary_hair(content: bytes, damaged: SceneFileError) -> tuple[NDArray[np.float64], list[int]]:
    """Points, and where among them a hair begins: an infinite number stands before its first point."""
    if len(content) < 15:
        raise damaged
    (count,) = struct.unpack_from("<I", content, 11)
    numbers = np.frombuffer(content, "<f4", (len(content) - 15) // 4, 15)
    marks = np.flatnonzero(np.isinf(numbers))
    values = np.delete(numbers, marks).astype(np.float64)
    if count > MOST_HAIR_POINTS or len(values) < 3 * count:
        raise damaged
    starts = (marks - np.arange(len(marks))) // 3
    return values[: 3 * count].reshape(-1, 3), [int(at) for at in starts if at < count]


def _ascii_hair(content: bytes) -> tuple[NDArray[np.float64], list[int]]:
    """The same of text: what is no point, such as an empty line, stands between two hairs."""
    points: list[tuple[float, ...]] = []
    starts: list[int] = []
    for line in content.decode("latin-1").splitlines():
        try:
            x, y, z = map(float, line.split()[:3])
        except ValueError:
            starts.append(len(points))
            continue
        points.append((x, y, z))
    return np.array(points).reshape(-1, 3), starts
