"""Surfaces that turn their back to the room, turned round.

Modellers rarely care which side of a wall is its front, and a material for both sides hides it. Methods do care: what
sees back faces is inside of something solid, and a lightmap holds the light of the front. Which way round a surface is
shows from the free space of the room, from where of one that is right no back is seen. The walls of a room are often
one shape with one of them the wrong way round, so each connected piece of a mesh is judged by itself.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from gibench.generators.imported.changes import Change
from gibench.generators.imported.scene import ImportedScene
from gibench.generators.imported.survey import hits
from gibench.generators.imported.tree import Node, copied, new, replaced
from gibench.generators.imported.turning import with_meshes_turned
from gibench.generators.parts import FloatArray
from gibench.rendering.free_space import NoFreeSpace, free_space, sphere
from gibench.rendering.scene import Scene

POINTS, RAYS = 1024, 256
LEAST_HITS = 8
MOST_FRONT = 0.1
"""Share of hits on its front below which a surface is the wrong way round; where both sides are seen it is near one
half."""

ONE_SIDED = (
    "dielectric",
    "roughdielectric",
    "thindielectric",
    "null",
    "principled",
    "principledthin",
    "hair",
)
"""Materials to which it matters which side they are seen from."""

BUMPS = ("bumpmap", "normalmap")
"""Dents that would be bulges from behind: the axes that they are given in turn with the surface."""

CURVES = ("linearcurve", "bsplinecurve", "sdfgrid", "ellipsoids", "ellipsoidsmesh")
"""Shapes whose normals Mitsuba cannot flip."""


RULE, WHAT = "orientation", "what of a shape turned its back to the room is turned round"


def oriented(scene: ImportedScene) -> tuple[ImportedScene, FloatArray]:
    """The scene with its shapes facing the room, where that changes nothing of the image, and its free space (N, 3).

    Needs a vectorised variant. Raises NoFreeSpace where nothing is enclosed, whichever way round it is.
    """
    try:
        found = free_space(scene.loaded)
    except NoFreeSpace:
        # A room whose walls all face outward has no inside: try it the other way round.
        inside_out = turned_round(scene, dict.fromkeys(scene.loaded.shapes, np.ones(1, dtype=bool)))
        if inside_out is scene:
            raise
        scene, found = inside_out, free_space(inside_out.loaded)
    turned = turned_round(scene, inverted(scene.loaded, found))
    if turned is scene:
        return scene, found
    return turned, free_space(turned.loaded)


def turned_round(scene: ImportedScene, wrong: Mapping[str, NDArray[np.bool_]]) -> ImportedScene:
    """The scene with faces of shapes turned round where both sides look the same; itself where none does.

    wrong: as `with_meshes_turned` takes it.
    """
    by_id = {node.get("id", ""): node for node in scene.tree.root.everything() if node.tag != "ref"}
    how = {name: sides(by_id[name], by_id) for name in wrong}
    chosen = {
        name: faces
        for name, faces in wrong.items()
        if how[name] is Sides.ALIKE or (how[name] is Sides.EXCHANGED and faces.all())
    }
    if not chosen:
        return scene
    # Turned twice is as it was.
    places = {change.where for change in scene.changes if change.rule == RULE}
    places ^= {by_id[name].where for name, faces in chosen.items() if faces.all()}
    places |= {by_id[name].where for name, faces in chosen.items() if not faces.all()}
    others = tuple(change for change in scene.changes if change.rule != RULE)
    changes = (*others, *(Change(RULE, WHAT, where) for where in sorted(places)))
    turned = with_meshes_turned(scene, chosen)
    exchanged(turned.tree.root, [name for name in chosen if how[name] is Sides.EXCHANGED])
    return replace(turned, changes=changes)


def inverted(scene: Scene, found: FloatArray) -> dict[str, NDArray[np.bool_]]:
    """Faces of which the points (N, 3) see backs, by shape id, as `with_meshes_turned` takes them.

    Needs a vectorised variant.
    """
    points = found[np.random.default_rng(2).permutation(len(found))[:POINTS]]
    directions = np.tile(sphere(RAYS), (len(points), 1))
    _, shape, face, normal = hits(scene, np.repeat(points, RAYS, axis=0), directions)
    front = np.einsum("rc,rc->r", normal, directions) < 0
    order = np.argsort(shape, kind="stable")
    numbers = np.arange(1, len(scene.shapes) + 2)
    bounds = np.searchsorted(shape[order], numbers)
    wrong = {}
    for loaded in scene.mi_scene.shapes():
        number = int(np.array(scene.shape_ids(mi.ShapePtr(loaded), mi.Bool(True)))[0])
        rays = order[bounds[number - 1] : bounds[number]]
        if loaded.is_mesh():
            faces = _wrong_faces(loaded, face[rays], front[rays])
        else:
            faces = np.array([_sees_backs(len(rays), np.count_nonzero(front[rays]))])
        if faces.any():
            wrong[loaded.id()] = faces
    return wrong


def _sees_backs(count: Any, fronts: Any) -> Any:
    return (count >= LEAST_HITS) & (fronts < MOST_FRONT * count)


def _wrong_faces(mesh: Any, face: NDArray[np.int64], front: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(F,) whether faces are the wrong way round. face, front: (R,), which one a ray met, and whether on its front.

    A piece is judged by all rays that met it. Where they disagree, it is seen from both sides, or it is no orderly
    surface: then each face by its own. What few rays met follows its shape.
    """
    faces = np.array(mesh.faces_buffer()).reshape(-1, 3)
    if not len(front):
        return np.zeros(len(faces), dtype=bool)
    of = pieces(np.array(mesh.vertex_positions_buffer()).reshape(-1, 3), faces)

    def votes(group: NDArray[np.int64], size: int) -> tuple[Any, Any]:
        return np.bincount(group, minlength=size), np.bincount(group, weights=front, minlength=size)

    count, fronts = votes(of[face], int(of.max()) + 1)
    wrong = _sees_backs(count, fronts)
    mixed = (count >= LEAST_HITS) & ~wrong & (fronts < (1 - MOST_FRONT) * count)
    unknown = count < LEAST_HITS
    whole = _sees_backs(len(front), np.count_nonzero(front))
    return np.where(mixed[of], _sees_backs(*votes(face, len(faces))), wrong[of] | (unknown[of] & bool(whole)))


def pieces(vertices: NDArray[Any], faces: NDArray[Any]) -> NDArray[np.int64]:
    """(F,) number of the connected piece of each face. Faces that share an edge and differ in winding do not connect.

    vertices: (V, 3); those at the same place are one. faces: (F, 3).
    """
    where = np.unique(vertices, axis=0, return_inverse=True)[1].reshape(-1)
    corners = where[faces.astype(np.int64)]
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    edge, reverse = start * len(vertices) + end, end * len(vertices) + start
    order = np.argsort(edge, kind="stable")
    at = np.minimum(np.searchsorted(edge[order], reverse), len(order) - 1)
    meets = edge[order][at] == reverse
    first, second = np.flatnonzero(meets) // 3, order[at][meets] // 3
    graph = coo_array((np.ones(len(first)), (first, second)), shape=(len(faces), len(faces)))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


class Sides(enum.Enum):
    """Effect of turning a surface round on its looks."""

    ALIKE, EXCHANGED, DIFFERENT = range(3)


def sides(shape: Node, by_id: Mapping[str, Node]) -> Sides:
    """Whether both sides of a shape look alike, look so once two materials of a `twosided` are exchanged, or do not."""
    if shape.nodes("emitter") or shape.type in CURVES:
        return Sides.DIFFERENT
    found = [_sides_of(part, by_id, (), within=False) for part in _materials(shape, by_id)]
    return max(found, key=lambda side: side.value, default=Sides.DIFFERENT)


def _materials(node: Node, by_id: Mapping[str, Node]) -> list[Node]:
    """The materials in a shape or material, references followed."""
    targets = [
        part if part.tag == "bsdf" else by_id[part.get("id", "")] for part in node.nodes("bsdf", "ref")
    ]
    return [target for target in targets if target.tag == "bsdf"]


def _sides_of(bsdf: Node, by_id: Mapping[str, Node], above: tuple[int, ...], *, within: bool) -> Sides:
    """within: inside of a `twosided`."""
    if id(bsdf) in above or bsdf.type in ONE_SIDED or bsdf.type in BUMPS:
        return Sides.DIFFERENT
    parts = _materials(bsdf, by_id)
    two_sided = within or bsdf.type == "twosided"
    inner = [_sides_of(part, by_id, (*above, id(bsdf)), within=two_sided) for part in parts]
    if not parts:
        return Sides.ALIKE if within or bsdf.type == "null" else Sides.DIFFERENT
    if bsdf.type == "twosided" and len(parts) == 2 and parts[0] is not parts[1]:
        inner.append(Sides.EXCHANGED)
    return max(inner, key=lambda side: side.value)


def exchanged(root: Node, names: Iterable[str]) -> None:
    """Exchange the two materials of every `twosided` of these shapes, in place; others that share them keep theirs."""
    by_id = {node.get("id", ""): node for node in root.everything() if node.tag != "ref"}
    made: dict[str, Node] = {}
    for shape in [by_id[name] for name in names]:
        for part in shape.nodes("bsdf", "ref"):
            target = part if part.tag == "bsdf" else by_id[part.get("id", "")]
            if target.tag != "bsdf":
                continue
            name = target.get("id", "")
            if name not in made:
                made[name] = _exchanged(target, by_id)
                fresh = f"{name}.turned"
                while fresh in by_id:
                    fresh += "."
                made[name].set("id", fresh)
                root.insert(0, made[name])
            replaced(shape, part, new("ref", part, id=made[name].get("id", "")))


def _exchanged(bsdf: Node, by_id: Mapping[str, Node]) -> Node:
    copy = new("bsdf", bsdf, **{key: value for key, value in bsdf.attrib.items() if key != "id"})
    for part in bsdf.nodes():
        target = by_id[part.get("id", "")] if part.tag == "ref" else part
        if target.tag != "bsdf":
            copy.append(copied(part))
            continue
        inner = _exchanged(target, by_id)
        if part.get("name"):
            inner.set("name", part.get("name", ""))
        copy.append(inner)
    if copy.type == "twosided":
        inside = copy.nodes("bsdf")
        for part in inside:
            copy.remove(part)
        copy.extend(reversed(inside))
    return copy
