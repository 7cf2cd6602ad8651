"""Shapes that turn their back to the room, turned round.

Modellers rarely care which side of a wall is its front, and a material for both sides hides it. Methods do care: what
sees back faces is inside of something solid. Whether a shape is the wrong way round shows from the free space of the
room, from where of a shape that is right no back is seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gibench.generators.imported.reading import Node
from gibench.generators.imported.scene import ImportedScene
from gibench.generators.imported.survey import hits
from gibench.generators.imported.turning import with_meshes_turned
from gibench.generators.imported.upgrading import Change
from gibench.generators.parts import FloatArray
from gibench.rendering.free_space import NoFreeSpace, free_space, sphere
from gibench.rendering.scene import Scene

POINTS, RAYS = 1024, 64
LEAST_HITS = 8
MOST_FRONT = 0.1
"""Share of hits on its front below which a shape is the wrong way round; for shapes in doubt it is near one half."""

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


RULE, WHAT = "orientation", "a shape that turned its back to the room is turned round"


def oriented(scene: ImportedScene) -> tuple[ImportedScene, FloatArray]:
    """The scene with its shapes facing the room, where that changes nothing of the image, and its free space (N, 3).

    Needs a vectorised variant. Raises NoFreeSpace where nothing is enclosed, whichever way round it is.
    """
    try:
        found = free_space(scene.loaded)
    except NoFreeSpace:
        # A room whose walls all face outward has no inside: try it the other way round.
        inside_out = turned_round(scene, scene.loaded.shapes)
        if inside_out is scene:
            raise
        scene, found = inside_out, free_space(inside_out.loaded)
    turned = turned_round(scene, inverted(scene.loaded, found))
    if turned is scene:
        return scene, found
    return turned, free_space(turned.loaded)


def turned_round(scene: ImportedScene, names: Sequence[str]) -> ImportedScene:
    """The scene with these shapes turned round where both sides look the same; itself where none does."""
    by_id = {node.get("id", ""): node for node in scene.tree.root.everything() if node.tag != "ref"}
    chosen = [name for name in names if _is_two_sided(by_id[name], by_id)]
    if not chosen:
        return scene
    # Turned twice is as it was.
    places = {change.where for change in scene.changes if change.rule == RULE}
    places ^= {by_id[name].where for name in chosen}
    others = tuple(change for change in scene.changes if change.rule != RULE)
    changes = (*others, *(Change(RULE, WHAT, where) for where in sorted(places)))
    return replace(with_meshes_turned(scene, chosen), changes=changes)


def inverted(scene: Scene, found: FloatArray) -> list[str]:
    """Ids of the shapes of which the points (N, 3) see backs. Needs a vectorised variant."""
    points = found[np.random.default_rng(2).permutation(len(found))[:POINTS]]
    directions = np.tile(sphere(RAYS), (len(points), 1))
    _, shape, normal = hits(scene, np.repeat(points, RAYS, axis=0), directions)
    front = np.einsum("rc,rc->r", normal, directions) < 0
    count = np.bincount(shape, minlength=len(scene.shapes) + 1)
    fronts = np.bincount(shape, weights=front, minlength=len(scene.shapes) + 1)
    wrong = (count >= LEAST_HITS) & (fronts < MOST_FRONT * count)
    return [scene.shapes[number - 1] for number in np.flatnonzero(wrong) if number > 0]


def _is_two_sided(shape: Node, by_id: dict[str, Node]) -> bool:
    if shape.nodes("emitter"):
        return False
    bsdfs = shape.nodes("bsdf") + [
        by_id[ref.get("id", "")] for ref in shape.nodes("ref") if by_id[ref.get("id", "")].tag == "bsdf"
    ]
    parts = [part.type for bsdf in bsdfs for part in bsdf.everything() if part.tag == "bsdf"]
    return "twosided" in parts and not any(part in ONE_SIDED for part in parts)
