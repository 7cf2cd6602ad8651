"""Disks, spheres and cylinders that reflect diffusely, as meshes: a lightmap needs triangles to lie on.

What only mirrors or refracts, and every lamp, stays the exact shape that it is.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gibench.generators.imported.changes import Note
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.reading import SceneTree
from gibench.generators.imported.transforms import matrix_of, numbers, triple
from gibench.generators.imported.tree import Node, new
from gibench.generators.parts import FloatArray, IntArray, Mesh
from gibench.generators.scene_files import ply_bytes

SEGMENTS = 128
"""Around a circle: its polygon is nowhere further away than 0.03 % of the radius."""

DIFFUSE = frozenset(
    {"diffuse", "plastic", "roughplastic", "pplastic", "principled", "principledthin", "measured"}
)
"""Materials with a diffuse lobe."""


def mesh_shapes(tree: SceneTree, note: Note) -> None:
    """Turn analytic shapes with a diffuse lobe into meshes, in place.

    Their UVs are those of the analytic shape. Raises SceneFileError for a shape of no size.
    """
    by_id = {node.get("id", ""): node for node in tree.root.everything() if node.tag != "ref"}
    for node in tree.root.nodes("shape"):
        make = MESHES.get(node.type)
        if make is None or node.nodes("emitter") or not _is_diffuse(node, by_id):
            continue
        mesh = make(node)
        if np.linalg.det(matrix_of(node.property("to_world"))[:3, :3]) < 0:
            mesh = _mirrored(node.type, mesh)
        name = tree.make(node.get("id", ""), ".ply", ply_bytes(mesh))
        note(node, f"a {node.type} is a mesh", loss=True)
        for gone in ("center", "radius", "p0", "p1"):
            if (part := node.property(gone)) is not None:
                node.remove(part)
        node.set("type", "ply")
        node.insert(0, new("string", node, name="filename", value=name))


def _mirrored(kind: str, mesh: Mesh) -> Mesh:
    """A mesh that a mirroring transformation follows, made so that it faces where Mitsuba's own shape does.

    A mirror image of triangles is wound the other way. Of a sphere Mitsuba turns the normals inward too; a disk's and a
    cylinder's stay on the side that they were on.
    """
    if kind == "sphere":
        return replace(mesh, normals=-mesh.normals)
    return replace(mesh, faces=mesh.faces[:, ::-1].copy())


def _is_diffuse(shape: Node, by_id: dict[str, Node]) -> bool:
    found = shape.nodes("bsdf") + [by_id[ref.get("id", "")] for ref in shape.nodes("ref")]
    bsdfs = [bsdf for bsdf in found if bsdf.tag == "bsdf"]
    # A shape without a material is diffuse; a material may refer to another.
    return not bsdfs or any(
        part.type in DIFFUSE or part.tag == "ref" for bsdf in bsdfs for part in bsdf.everything()
    )


def _disk(_node: Node) -> Mesh:
    """A fan whose middle is a corner of each triangle of its own, since u = r and v = φ/2π have a seam."""
    turn = np.linspace(0, 1, SEGMENTS + 1)
    rim = np.stack([np.cos(2 * math.pi * turn), np.sin(2 * math.pi * turn), 0 * turn], axis=1)
    vertices = np.concatenate([rim, np.zeros((SEGMENTS, 3))])
    uvs = np.concatenate(
        [
            np.stack([np.ones_like(turn), turn], axis=1),
            np.stack([np.zeros(SEGMENTS), (turn[:-1] + turn[1:]) / 2], axis=1),
        ]
    )
    i = np.arange(SEGMENTS)
    faces = np.stack([SEGMENTS + 1 + i, i, i + 1], axis=1).astype(np.int32)
    return Mesh(vertices, faces, np.tile([0.0, 0, 1], (len(vertices), 1)), uvs)


def _sphere(node: Node) -> Mesh:
    centre = node.property("center")
    middle = np.zeros(3) if centre is None else triple(centre, 0.0)
    radius = _radius(node)
    u, v = np.meshgrid(np.linspace(0, 1, SEGMENTS + 1), np.linspace(0, 1, SEGMENTS // 2 + 1))
    theta, phi = math.pi * v.ravel(), 2 * math.pi * u.ravel()
    out = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    faces = _grid(SEGMENTS // 2, SEGMENTS, outward=True)
    return Mesh(middle + radius * out, faces, out, np.stack([u.ravel(), v.ravel()], axis=1))


def _cylinder(node: Node) -> Mesh:
    ends = [node.property(name) for name in ("p0", "p1")]
    p0, p1 = (
        default if end is None else triple(end, 0.0)
        for end, default in zip(ends, (np.zeros(3), np.array([0.0, 0, 1])), strict=True)
    )
    axis = p1 - p0
    length = float(np.linalg.norm(axis))
    if length == 0:
        raise SceneFileError(f"{node.where}: the cylinder has no length")
    axis /= length
    across, up = _frame(axis)
    u, v = np.meshgrid(np.linspace(0, 1, SEGMENTS + 1), [0.0, 1.0])
    phi = 2 * math.pi * u.ravel()
    out = np.cos(phi)[:, None] * across + np.sin(phi)[:, None] * up
    vertices = p0 + _radius(node) * out + v.ravel()[:, None] * (p1 - p0)
    return Mesh(vertices, _grid(1, SEGMENTS, outward=False), out, np.stack([u.ravel(), v.ravel()], axis=1))


def _frame(normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The two axes that Mitsuba puts beside a unit vector (Duff et al. 2017), so that UVs begin where its own do."""
    x, y, z = normal
    sign = math.copysign(1.0, z)
    a = -1 / (sign + z)
    b = x * y * a
    return np.array([x * x * a * sign + 1, b * sign, -sign * x]), np.array([b, y * y * a + sign, -y])


def _radius(node: Node) -> float:
    radius = node.property("radius")
    value = 1.0 if radius is None else float(numbers(radius, radius.get("value", ""), 1)[0])
    if value <= 0:
        raise SceneFileError(f"{node.where}: the {node.type} has a radius of {value:g}")
    return value


def _grid(rows: int, columns: int, *, outward: bool) -> IntArray:
    """(2 · rows · columns, 3) faces of a grid of (rows + 1) × (columns + 1) vertices."""
    row, column = (index.ravel() for index in np.indices((rows, columns)))
    a = row * (columns + 1) + column
    b, c = a + 1, a + columns + 1
    faces = np.concatenate([np.stack([a, c, b], axis=1), np.stack([b, c, c + 1], axis=1)])
    return (faces if outward else faces[:, ::-1]).astype(np.int32)


MESHES = {"disk": _disk, "sphere": _sphere, "cylinder": _cylinder}
