"""An imported scene without its ceiling, or without the ceiling and one wall, cut out of its meshes.

A ceiling is seldom a shape of its own, so faces are what is taken away: all that lie beyond a plane just below the
ceiling, which is found with rays from the free space, and all shapes there that are no meshes. A wall is found alike.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gibench.generators.imported.changes import Change
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.scene import ImportedScene
from gibench.generators.imported.turning import with_faces_removed
from gibench.generators.opened import check_opened
from gibench.generators.parts import FloatArray
from gibench.rendering.free_space import fan

DEPTH = 0.05
"""Distance below the ceiling, or before the wall, at which faces are still a part of it, m."""

WINDOW = 0.1
"""Heights that differ by less are those of one ceiling, m."""

POINTS = 1024

LEAST_OPEN = 0.5
"""Share of the free space over which there must be nothing any more."""

RULE = "opened"
SIDES = {"+x": (1.0, 0.0, 0.0), "-x": (-1.0, 0.0, 0.0), "+y": (0.0, 1.0, 0.0), "-y": (0.0, -1.0, 0.0)}
UP = (0.0, 0.0, 1.0)


def opened_scene(scene: ImportedScene, opened: str, found: FloatArray) -> ImportedScene:
    """The scene without its ceiling, and for "stage" without one wall.

    The wall is the one behind the scene's first camera, or without a camera that with the fewest faces. found: (N, 3)
    points of the free space, metres. Needs a vectorised variant.

    Raises UnknownOpening, and SceneFileError where most of the free space still has something over it afterwards.
    """
    if check_opened(opened) == "none":
        return scene
    scene = _cut(scene, UP, found, "the ceiling")
    if opened == "ceiling":
        return scene
    side = _side_behind(scene)
    if side is None:
        faces = {
            name: sum(int(g.sum()) for g in _beyond(scene, way, found).values())
            for name, way in SIDES.items()
        }
        side = min(faces, key=lambda name: faces[name] or len(found) * 10**6)
    return _cut(scene, SIDES[side], found, f"the wall at {side}")


def _side_behind(scene: ImportedScene) -> str | None:
    """The side that the scene's first camera has its back to."""
    if not scene.cameras:
        return None
    camera = scene.cameras[0].at(scene.resolution)
    back = np.subtract(camera.position, camera.target)
    return max(SIDES, key=lambda name: float(back @ np.array(SIDES[name])))


def _cut(
    scene: ImportedScene, way: tuple[float, float, float], found: FloatArray, what: str
) -> ImportedScene:
    gone = _beyond(scene, way, found)
    places = {node.get("id", ""): node.where for node in scene.tree.root.nodes("shape")}
    changes = (Change(RULE, f"{what} is taken away", places[name], loss=True) for name in sorted(gone))
    cut = replace(with_faces_removed(scene, gone), changes=(*scene.changes, *changes)) if gone else scene
    points = _some(found)
    open_to = ~np.isfinite(fan(cut.loaded, points, np.array([way]))[0][:, 0])
    if open_to.mean() < LEAST_OPEN:
        raise SceneFileError(
            f"{scene.tree.file}: {what} cannot be taken away: {1 - open_to.mean():.0%} of the room still have "
            "something there; leave opened out, or use another scene"
        )
    return cut


def _beyond(
    scene: ImportedScene, way: tuple[float, float, float], found: FloatArray
) -> dict[str, NDArray[np.bool_]]:
    """Faces (F,) that lie where the room ends in a direction, or beyond, by shape id; (1,) where it is no mesh."""
    towards = np.array(way)
    points = _some(found)
    reach = fan(scene.loaded, points, towards[None])[0][:, 0]
    ends = np.sort((points @ towards + reach)[np.isfinite(reach)])
    if not len(ends):
        return {}
    # Where most of what is met lies; of several such planes the farthest.
    votes = np.searchsorted(ends, ends + WINDOW) - np.searchsorted(ends, ends)
    plane = float(ends[len(ends) - 1 - int(np.argmax(votes[::-1] >= votes.max()))]) - DEPTH
    gone = {}
    for shape in scene.loaded.mi_scene.shapes():
        if shape.is_mesh():
            vertices = np.array(shape.vertex_positions_buffer(), dtype=np.float64).reshape(-1, 3)
            faces = np.array(shape.faces_buffer(), dtype=np.int64).reshape(-1, 3)
            beyond = (vertices @ towards >= plane)[faces].all(axis=1)
        else:
            box = shape.bbox()
            low, high = np.array(box.min, dtype=float).ravel(), np.array(box.max, dtype=float).ravel()
            beyond = np.array([np.minimum(low * towards, high * towards).sum() >= plane])
        if beyond.any():
            gone[shape.id()] = beyond
    return gone


def _some(found: FloatArray) -> FloatArray:
    return found[np.random.default_rng(4).permutation(len(found))[:POINTS]]
