"""A room from a seed: shell, furniture, materials, lights and cameras, tried until all of it holds together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gibench.errors import GibenchError
from gibench.generators.cameras import (
    PATHS,
    NoView,
    PathPlan,
    ViewSpace,
    sample_path,
    sample_planned,
    sample_spread,
    sample_stills,
)
from gibench.generators.daylight import sample_daylight
from gibench.generators.gloss import GLOSS, MUCH, visible_gloss
from gibench.generators.layouts import FURNISH
from gibench.generators.layouts.placement import FloorPlan, Placed, RejectedRoom
from gibench.generators.layouts.solids import bounds_of, component_boxes, moved, triangles, whole_box
from gibench.generators.light_shapes import placed_light
from gibench.generators.lighting import light_room
from gibench.generators.materials import is_glossy
from gibench.generators.outside import GROUND, ground_material
from gibench.generators.palette import Palette
from gibench.generators.parts import Environment, FloatArray, Light, Mesh, Part, Room, RoomObject
from gibench.generators.poses import stand
from gibench.generators.shapes import merge
from gibench.generators.shell_sampling import sample_shell
from gibench.generators.still_life import scene as still_life
from gibench.generators.trajectories import Spread
from gibench.generators.visibility import RayCaster, Surface

KINDS = tuple(FURNISH)
ALL_KINDS = (*KINDS, still_life.KIND)  # with those that are no rooms, which must be asked for
# A lane is known by its place here: new ones go to the end, or every room of every seed changes.
LANES = ("kind", "shell", "layout", "materials", "lights", "cameras", "environment", "path")
TRIES = 12  # of one room before it is given up
LEAST_FREE = 0.8  # floor that cameras may stand on, m²
LEAST_THINGS = 14  # pieces of furniture, lamps and small things included
SMALL = 0.6  # longest side of what counts as a small thing, m
DETAIL = 0.1  # longest side of what a view may be judged without, m
GLOSSY_SHARE = 0.5  # share of rooms that are given a polished surface on purpose
GLOSSY_AREA = 0.5  # least area of a surface that counts as large, m²
LARGE = frozenset(
    {"floor", "wall", "dining_table", "desk", "coffee_table", "wardrobe", "dresser", "tv_stand"}
) | {
    "kitchen_counter",
    "splashback",
    "fridge",
    "bathtub",
    "mirror",
    "tv",
}  # families with surfaces in one piece


class UnknownKind(GibenchError):
    """A room kind or a kind of camera path that does not exist."""


def sample_room(
    seed: int,
    index: int,
    *,
    kind: str | None = None,
    kinds: Sequence[str] = KINDS,
    views: int = 4,
    path: str | None = None,
    path_views: int = 0,
    sequences: Sequence[PathPlan] = (),
    spread: Spread | None = None,
    environment: Environment | str | None = None,
    gloss: str = "any",
    **fixed: Any,
) -> Room:
    """Draw room number `index` of the run `seed`; it depends on these two and on the options alone.

    kind: of the room, one of ALL_KINDS; drawn from `kinds` if None. views: number of cameras. path: None for stills, or
    "walk", "orbit" or "eight" for one path of that many frames. path_views: cameras on the path in a room that has
    stills too: above 0 the `views` are stills, as without a path, and these come after them. sequences: the same for
    any number of paths by name, in place of `path`. spread: of stills that lie on trajectories and away from them.
    environment: what lies outside: "none", "sunsky", the path of an
    HDR panorama, or an Environment; drawn if None. gloss: "any", or "much" for the same rooms with polished floors and
    furniture, of which the cameras see at least the share `gloss.MUCH`; `Room.parameters` then says how much.
    fixed: arguments of `build_shell` that are not drawn, such as width=4.0.

    A try that fails is counted in `Room.rejections` by its reason and drawn again. Raises RejectedRoom when all
    tries have failed, UnknownKind for a kind or path that does not exist.
    """
    if gloss not in GLOSS:
        raise UnknownKind(f"there is no gloss {gloss!r}; choose from {', '.join(GLOSS)}")
    for name in kinds if kind is None else (kind,):
        if name not in ALL_KINDS:
            raise UnknownKind(f"there is no room kind {name!r}; choose from {', '.join(ALL_KINDS)}")
    if path is not None and path not in PATHS:
        raise UnknownKind(f"there is no camera path {path!r}; choose from {', '.join(PATHS)}")
    if path_views and path is None:
        raise UnknownKind(f"{path_views} cameras on no path: choose path from {', '.join(PATHS)}")
    if path is not None and path_views:
        sequences, path = (PathPlan(path, path, path_views),), None
    rejections: Counter[str] = Counter()
    if kind is None:
        kind = kinds[int(_lane(seed, index, "kind", 0).integers(len(kinds)))]
    for attempt in range(TRIES):
        try:
            room = _try_room(
                seed,
                index,
                attempt,
                kind,
                views,
                path,
                sequences,
                spread,
                environment,
                gloss,
                fixed,
                rejections,
            )
        except RejectedRoom as refusal:
            rejections[refusal.reason] += 1
        except NoView as refusal:
            rejections.update({f"view: {reason}": count for reason, count in refusal.reasons.items()})
            rejections[f"no {refusal.what}"] += 1
        else:
            return room
    worst = ", ".join(f"{reason} {count}" for reason, count in rejections.most_common(3))
    raise RejectedRoom(
        f"room {index} of seed {seed} ({kind}) failed {TRIES} times ({worst})",
        "leave out fixed sizes, or skip this index",
    )


def _lane_seed(seed: int, index: int, lane: str, attempt: int, number: int = 0) -> np.random.SeedSequence:
    """number: of several things that one lane draws."""
    key = (index, LANES.index(lane), attempt, *([number] if number else []))
    return np.random.SeedSequence(seed, spawn_key=key)


def _lane(seed: int, index: int, lane: str, attempt: int, number: int = 0) -> np.random.Generator:
    return np.random.default_rng(_lane_seed(seed, index, lane, attempt, number))


def _try_room(
    seed: int,
    index: int,
    attempt: int,
    kind: str,
    views: int,
    path: str | None,
    sequences: Sequence[PathPlan],
    spread: Spread | None,
    environment: Environment | str | None,
    gloss: str,
    fixed: Mapping[str, Any],
    rejections: Counter[str],
) -> Room:
    def lane(name: str, number: int = 0) -> np.random.Generator:
        return _lane(seed, index, name, attempt, number)

    if kind == still_life.KIND:
        return still_life.build_still_life(
            seed,
            index,
            attempt,
            lane,
            views=views,
            path=path,
            sequences=sequences,
            spread=spread,
            environment=environment,
        )
    shell = sample_shell(lane("shell"), kind, **fixed)
    plan = FloorPlan(shell, kind, lane("layout"))
    FURNISH[kind](plan)
    light_room(lane("lights"), plan)
    if len(plan.placed) < LEAST_THINGS:
        raise RejectedRoom("few things")
    free = plan.free_floor()
    if free.area < LEAST_FREE:
        raise RejectedRoom("no free floor")

    palette = Palette(_lane_seed(seed, index, "materials", attempt), kind)
    if gloss == "much":
        _polish_everything(palette, plan)
    else:
        _polish_something(palette, plan)
    objects = _objects(plan, palette)

    stage = ViewSpace(free, shell.height, _middles(plan), _caster(plan), len(shell.pieces))
    if spread is not None:
        cameras, refused = sample_spread(lane("cameras"), stage, views, spread)
    elif path is None:
        cameras, refused = sample_stills(lane("cameras"), stage, views) if views else ((), Counter())
    else:
        cameras, refused = sample_path(lane("cameras"), stage, path, views)
    for number, sequence in enumerate(sequences):
        walked, refused_too = sample_planned(lane("path", number), stage, sequence)
        cameras, refused = cameras + walked, refused + refused_too
    rejections.update({f"view: {reason}": count for reason, count in refused.items()})
    shine: dict[str, float] = {}
    if gloss == "much":
        shine["gloss"] = round(visible_gloss(objects, palette.materials, cameras), 4)
        if shine["gloss"] < MUCH:
            raise RejectedRoom("little gloss")

    lights = tuple(_light(light, p, palette) for p in plan.placed for light in p.furniture.lights)
    if isinstance(environment, str):
        kind_outside, panorama = (
            (environment, None) if environment in ("none", "sunsky") else ("hdr", environment)
        )
        environment = sample_daylight(lane("environment"), kind=kind_outside, path=panorama)
    elif environment is None:
        environment = sample_daylight(lane("environment"))
    materials = dict(palette.materials)
    if environment.kind == "sunsky":
        materials[GROUND] = ground_material(environment)
    parameters = {
        "shell": dict(shell.parameters),
        "attempt": attempt,
        "glossy": _large_glossy(objects, palette),
        **shine,
    }
    return Room(
        seed,
        index,
        kind,
        parameters,
        objects,
        lights,
        environment,
        materials,
        cameras,
        shell.window_rectangles,
        dict(rejections),
    )


def _caster(plan: FloorPlan) -> RayCaster:
    """Rays against everything in the room; the owner of a hit is the number of the object.

    The shell is what it is, but furniture is made of boxes here: the grid of rays is coarser than its details, and
    a tenth of the triangles makes for a tenth of the building time.
    """
    surfaces: list[Mesh | Surface] = []
    owners: list[int] = []
    for number, piece in enumerate(plan.shell.pieces):
        surfaces += [part.mesh for part in piece.parts]
        owners += [number] * len(piece.parts)
    for number, thing in enumerate(plan.placed, len(plan.shell.pieces)):
        surfaces.append(triangles(_solid(thing)))
        owners.append(number)
    return RayCaster(surfaces, owners)


def _solid(thing: Placed) -> FloatArray:
    """(N, 7) boxes that hide what a thing hides: one for a small thing, else one for each larger surface."""
    low, high = bounds_of(thing.furniture)
    if (high - low).max() < SMALL:
        return moved(whole_box(thing.furniture), thing.position, thing.yaw)
    boxes = component_boxes(thing.furniture)
    sizes = np.column_stack([2 * boxes[:, 2:4], boxes[:, 6] - boxes[:, 5]]).max(1)
    return moved(boxes[sizes >= min(DETAIL, sizes.max())], thing.position, thing.yaw)


def _middles(plan: FloorPlan) -> FloatArray:
    """(N, 3) middles of the furniture, which is what cameras look at."""
    return np.array([[*p.position[:2], (p.boxes[:, 5].min() + p.boxes[:, 6].max()) / 2] for p in plan.placed])


def _polish_something(palette: Palette, plan: FloorPlan) -> None:
    """Half the rooms get one large surface that shows reflections."""
    rng = palette.rng("polish")
    wanted, favourite = rng.random() < GLOSSY_SHARE, rng.random()
    if not wanted:
        return
    choices = _polishable(plan)
    # The floor is the largest mirror of a room, and the most common one.
    choice = 0 if favourite < 0.5 else int(rng.integers(len(choices)))
    palette.polish(*choices[choice])


def _polish_everything(palette: Palette, plan: FloorPlan) -> None:
    """The floor and all furniture with surfaces in one piece show reflections."""
    for family, slot in _polishable(plan):
        palette.polish(family, slot)


def _polishable(plan: FloorPlan) -> list[tuple[str, str]]:
    """Families and slots with large surfaces that take a polish, the floor first."""
    choices = [("floor", "floor")]
    for thing in plan.placed:
        slots = {part.slot for part in thing.furniture.parts}
        if thing.furniture.family in LARGE:
            choices += [
                (thing.furniture.family, slot) for slot in ("wood", "lacquer", "stone") if slot in slots
            ]
    return choices


def _objects(plan: FloorPlan, palette: Palette) -> tuple[RoomObject, ...]:
    objects = []
    for piece in plan.shell.pieces:
        shapes = _shapes(piece.name, piece.family, piece.parts, palette, (0.0, 0.0, 0.0), 0.0)
        objects.append(RoomObject(piece.name, piece.family, {}, (0.0, 0.0, 0.0), 0.0, shapes))
    for thing in plan.placed:
        family, parts = thing.furniture.family, thing.furniture.parts
        shapes = _shapes(thing.name, family, parts, palette, thing.position, thing.yaw)
        parameters = thing.furniture.parameters
        objects.append(RoomObject(thing.name, family, parameters, thing.position, thing.yaw, shapes))
    return tuple(objects)


def _light(light: Light, lamp: Placed, palette: Palette) -> Light:
    """A lamp's light in the world, its slot filled."""
    placed = placed_light(light, lamp.name, lamp.position, lamp.yaw)
    if not light.slot:
        return placed
    return replace(placed, slot=palette.name_of(lamp.name, lamp.furniture.family, light.slot, ""))


def _shapes(
    name: str,
    family: str,
    parts: Sequence[Part],
    palette: Palette,
    position: tuple[float, float, float],
    yaw: float,
) -> tuple[tuple[Mesh, str], ...]:
    """Parts in the world, those of one material joined."""
    by_material: dict[str, list[Mesh]] = {}
    for part in parts:
        material = palette.name_of(name, family, part.slot, part.variant)
        by_material.setdefault(material, []).append(part.mesh)
    return tuple((stand(merge(meshes), position, yaw), material) for material, meshes in by_material.items())


def _large_glossy(objects: Sequence[RoomObject], palette: Palette) -> list[str]:
    """Names of the things that show reflections over more than GLOSSY_AREA."""
    names = []
    for thing in objects:
        if thing.family not in LARGE:
            continue
        area = 0.0
        for mesh, material in thing.shapes:
            if is_glossy(palette.materials[material]):
                corners = mesh.vertices[mesh.faces]
                sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
                area += float(np.linalg.norm(sides, axis=1).sum()) / 2
        if area > GLOSSY_AREA:
            names.append(thing.name)
    return names
