"""Surfaces that turn their back to the room, turned round.

Modellers rarely care which side of a wall is its front, and a material for both sides hides it. Methods do care: what
sees back faces is inside of something solid, and a lightmap holds the light of the front. Which way round a surface is
shows from the free space of the room, from where of one that is right no back is seen. The walls of a room are often
one shape with one of them the wrong way round, so each connected piece of a mesh is judged by itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from gibench.generators.imported.reading import Node
from gibench.generators.imported.scene import ImportedScene
from gibench.generators.imported.survey import hits
from gibench.generators.imported.turning import with_meshes_turned
from gibench.generators.imported.upgrading.rules import Change
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
    chosen = {name: faces for name, faces in wrong.items() if _is_two_sided(by_id[name], by_id)}
    if not chosen:
        return scene
    # Turned twice is as it was.
    places = {change.where for change in scene.changes if change.rule == RULE}
    places ^= {by_id[name].where for name, faces in chosen.items() if faces.all()}
    places |= {by_id[name].where for name, faces in chosen.items() if not faces.all()}
    others = tuple(change for change in scene.changes if change.rule != RULE)
    changes = (*others, *(Change(RULE, WHAT, where) for where in sorted(places)))
    return replace(with_meshes_turned(scene, chosen), changes=changes)


def inverted(scene: Scene, found: FloatArray) -> dict[str, NDArray[np.bool_]]:
    """Faces of which the points (N, 3) see backs, by shape id, as `with_meshes_turned` takes them.

    Needs a vectorised variant.
    """
    import mitsuba as mi

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


def _is_two_sided(shape: Node, by_id: dict[str, Node]) -> bool:
    if shape.nodes("emitter"):
        return False
    bsdfs = shape.nodes("bsdf") + [
        by_id[ref.get("id", "")] for ref in shape.nodes("ref") if by_id[ref.get("id", "")].tag == "bsdf"
    ]
    parts = [part.type for bsdf in bsdfs for part in bsdf.everything() if part.tag == "bsdf"]
    return "twosided" in parts and not any(part in ONE_SIDED for part in parts)
