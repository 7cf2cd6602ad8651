"""Rooms without their ceiling, or without the ceiling and one wall like a stage, so that light from outside gets in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gibench.errors import GibenchError
from gibench.generators.furniture import FAMILIES
from gibench.generators.parts import FloatArray, Mesh, Room, RoomObject
from gibench.generators.shell import Wall, footprint_corners, measured_walls

OPENED = ("none", "ceiling", "stage")
"""Parts that are taken away: nothing, the ceiling, or the ceiling and one wall."""

HANGING = frozenset({"ceiling_panel", "downlight"}) | {n for n, f in FAMILIES.items() if f.mount == "ceiling"}
ON_WALLS = frozenset({"splashback"}) | {n for n, f in FAMILIES.items() if f.mount == "wall"}

CLOSE = 0.15
"""Largest distance from a wall of things that hang on it, m."""

STANDS = 0.02
"""Largest height above a thing of things that stand on it, m."""


class UnknownOpening(GibenchError):
    """Something to be taken away that rooms do not have."""


def check_opened(opened: str) -> str:
    """One of `OPENED`. Raises UnknownOpening."""
    if opened not in OPENED:
        raise UnknownOpening(f"opened: '{opened}' is not allowed; allowed is one of {', '.join(OPENED)}")
    return opened


def opened_room(room: Room, opened: str) -> Room:
    """The room without its ceiling and what hangs from it, and for "stage" without one wall and what hangs on that.

    The wall is the one that the least furniture stands at, the longer one of two. Cameras stay, and see the outside
    where the wall was. What is no room, a still life, is open as it is. Raises UnknownOpening.
    """
    check_opened(opened)
    shell = room.parameters.get("shell")
    if opened == "none" or shell is None:
        return room
    gone = {thing.name for thing in room.objects if thing.family == "ceiling" or thing.family in HANGING}
    parameters = {**room.parameters, "opened": opened}
    wall = None
    if opened == "stage":
        corners = footprint_corners(shell["width"], shell["depth"], shell["notch"])
        walls = measured_walls(corners, shell["wall_thickness"])
        wall = _open_wall(room, walls)
        parameters["open_wall"] = wall.index
        gone |= _of_wall(room, wall, shell["openings"])
    gone |= _standing_on(room, gone)
    objects = [thing for thing in room.objects if thing.name not in gone]
    if wall is not None:
        objects = [
            _without_skirting(thing, wall) if thing.family == "skirting" else thing for thing in objects
        ]
    lights = tuple(light for light in room.lights if light.name.rsplit(".", 1)[0] not in gone)
    used = {material for thing in objects for _, material in thing.shapes}
    was = {material for thing in room.objects for _, material in thing.shapes}
    return replace(
        room,
        parameters=parameters,
        objects=tuple(objects),
        lights=lights,
        materials={name: m for name, m in room.materials.items() if name in used or name not in was},
        # Where most of the sky is seen, portals cost a third more noise than they save.
        openings=room.openings[:0],
    )


def _open_wall(room: Room, walls: Sequence[Wall]) -> Wall:
    """Of the walls at the outside of the footprint that with the least furniture along each of its metres."""
    x, y = np.array([wall.start for wall in walls]).T
    low, high = np.array([x.min(), y.min()]), np.array([x.max(), y.max()])

    def furniture(wall: Wall) -> float:
        return sum(
            float(np.ptp(_along(thing, wall)))
            for thing in room.objects
            if thing.family in FAMILIES
            and FAMILIES[thing.family].mount == "floor"
            and _away(thing, wall).min() < CLOSE
        )

    outer = [
        wall
        for wall in walls
        if any(
            np.isclose(wall.start[k], edge) and np.isclose(wall.end[k], edge)
            for k in (0, 1)
            for edge in (low[k], high[k])
        )
    ]
    return min(outer, key=lambda wall: (round(furniture(wall) / wall.length, 3), -wall.length))


def _away(thing: RoomObject, wall: Wall) -> FloatArray:
    """Distances of the vertices of a thing from a wall's inner face, metres; negative inside the wall."""
    return (_vertices(thing)[:, :2] - wall.start) @ wall.inward


def _along(thing: RoomObject, wall: Wall) -> FloatArray:
    return (_vertices(thing)[:, :2] - wall.start) @ wall.along


def _vertices(thing: RoomObject) -> FloatArray:
    return np.concatenate([mesh.vertices for mesh, _ in thing.shapes])


def _of_wall(room: Room, wall: Wall, openings: Sequence[dict[str, object]]) -> set[str]:
    """Names of a wall, its windows and door, and of what hangs on it."""
    names = {f"wall.{wall.index}"}
    windows = [o for o in openings if o["kind"] == "window"]
    names |= {f"window.{k}" for k, o in enumerate(windows) if o["wall"] == wall.index}
    if any(o["kind"] == "door" and o["wall"] == wall.index for o in openings):
        names.add("door")
    for thing in room.objects:
        if thing.family in ON_WALLS and _away(thing, wall).min() < CLOSE:
            along = _along(thing, wall)
            # Not what hangs on the next wall and reaches into the corner.
            if np.ptp(along) > np.ptp(_away(thing, wall)) and 0 < along.mean() < wall.length:
                names.add(thing.name)
    return names


def _standing_on(room: Room, gone: set[str]) -> set[str]:
    """Names of what stands on or in the things on walls that are gone."""
    carriers = [t for t in room.objects if t.name in gone and t.family in ON_WALLS]
    boxes = [(_vertices(t).min(axis=0), _vertices(t).max(axis=0)) for t in carriers]
    names = set()
    for thing in room.objects:
        vertices = _vertices(thing)
        middle, bottom = (vertices.min(axis=0) + vertices.max(axis=0))[:2] / 2, vertices[:, 2].min()
        for low, high in boxes:
            inside = (middle > low[:2]).all() and (middle < high[:2]).all()
            if inside and low[2] < bottom < high[2] + STANDS:
                names.add(thing.name)
    return names


def _without_skirting(thing: RoomObject, wall: Wall) -> RoomObject:
    """The skirting of the other walls."""
    shapes = []
    for mesh, material in thing.shapes:
        # In the wall's frame: what lies along it, and no farther away than the thickest skirting.
        at_wall = np.asarray((mesh.vertices[:, :2] - wall.start) @ wall.inward < 0.02)
        gone = np.asarray(at_wall[mesh.faces].all(axis=1))
        shapes.append((without_faces(mesh, gone), material))
    return replace(thing, shapes=tuple((mesh, material) for mesh, material in shapes if len(mesh.faces)))


def without_faces(mesh: Mesh, gone: NDArray[np.bool_]) -> Mesh:
    """A mesh without some of its faces, (F,), and without the vertices that no other face has."""
    faces = mesh.faces[~gone]
    kept = np.unique(faces)
    row = np.zeros(len(mesh.vertices), dtype=np.int32)
    row[kept] = np.arange(len(kept))
    normals, uvs = (values[kept] if len(values) else values for values in (mesh.normals, mesh.uvs))
    return Mesh(mesh.vertices[kept], row[faces].reshape(-1, 3), normals, uvs)
