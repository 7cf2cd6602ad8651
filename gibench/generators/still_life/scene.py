"""A still life from random lanes: what is in it, what it is made of, where it stands, and who looks at it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from gibench.generators.cameras import PathPlan
from gibench.generators.daylight import sample_daylight
from gibench.generators.environments.files import environment_files
from gibench.generators.layouts.placement import LIFT, RejectedRoom
from gibench.generators.materials import is_glossy, sample_material
from gibench.generators.materials.metal import metal
from gibench.generators.materials.paint import paint
from gibench.generators.outside import GROUND, ground_material
from gibench.generators.parts import Environment, Material, Mesh, Room, RoomObject
from gibench.generators.poses import stand
from gibench.generators.shapes import box, cylinder, merge, rounded_box
from gibench.generators.still_life.cameras import sample_path, sample_spread, sample_stills
from gibench.generators.still_life.figures import ANIMALS
from gibench.generators.still_life.things import RING, THINGS, sample_thing
from gibench.generators.trajectories import Spread

KIND = "still-life"

COUNT = (4, 9)
"""Things, the ring included."""

REACH = (0.22, 0.34)
"""Distance of things from the middle, m."""

GAP = 0.015
"""Least distance between two things, m."""

PLACES = 200
"""Tried for one thing before the still life is drawn again."""

RING_FINISHES = ("gold", "copper", "silver", "chrome", "brass")
RING_ALPHA = (0.01, 0.06)

METALS = ("gold", "copper", "silver", "chrome", "brass", "bronze", "aluminium")
METAL_ALPHA, COAT_ALPHA = (0.03, 0.25), (0.01, 0.2)
FINISHES = ("metal", "coat", "matt")

SUPPORTS = ("ground", "table")
GROUND_SIZE = 4.0
TABLE_HEIGHT = 0.74


def build_still_life(
    seed: int,
    index: int,
    attempt: int,
    lane: Callable[..., np.random.Generator],
    *,
    views: int,
    path: str | None,
    sequences: Sequence[PathPlan],
    spread: Spread | None,
    environment: Environment | str | None,
) -> Room:
    """One try at a still life; arguments as of `rooms.sample_room`. lane: name and number → its random numbers.

    environment: one of the maps that ship to train on if None. Raises RejectedRoom where the things do not fit.
    """
    layout, materials = lane("layout"), lane("materials")
    support = str(layout.choice(SUPPORTS))
    names = _names(layout)
    places = _arranged(layout, [sample_thing(layout, name) for name in names])
    finishes = _finishes(materials, len(names) - 1)
    used: dict[str, Material] = {}
    objects = [_support(materials, support, places, used)]
    for number, (name, mesh) in enumerate(zip(names, places, strict=True)):
        material = _ring_metal(materials) if name == RING else _finished(materials, finishes[number - 1])
        used[material.name] = material
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        where = (float(low[0] + high[0]) / 2, float(low[1] + high[1]) / 2, float(low[2]))
        objects.append(RoomObject(f"{name}.{number}", name, {}, where, 0.0, ((mesh, material.name),)))
    if environment is None:
        maps = environment_files("train")
        environment = str(maps[int(lane("environment").integers(len(maps)))].path)
    if isinstance(environment, str):
        own = environment not in ("none", "sunsky")
        environment = sample_daylight(
            lane("environment"), kind="hdr" if own else environment, path=environment if own else None
        )
    if environment.kind == "sunsky":
        used[GROUND] = ground_material(environment)

    corners = np.concatenate([mesh.vertices for mesh in places])
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    radius = float(np.linalg.norm(corners - middle, axis=1).max())
    if spread is not None:
        cameras = sample_spread(lane("cameras"), middle, radius, views, spread)
    elif path is None:
        cameras = sample_stills(lane("cameras"), middle, radius, views)
    else:
        cameras = sample_path(lane("cameras"), middle, radius, path, views)
    for number, plan in enumerate(sequences):
        rng = lane("path", number)
        if plan.moves == "light":
            drawn = sample_stills(rng, middle, radius, 1) * plan.frames
        else:
            drawn = sample_path(rng, middle, radius, plan.kind, plan.frames)
        cameras += plan.named(drawn)
    glossy = [thing.name for thing in objects[1:] if is_glossy(used[thing.shapes[0][1]])]
    parameters: dict[str, Any] = {"support": support, "attempt": attempt, "glossy": glossy}
    return Room(seed, index, KIND, parameters, tuple(objects), (), environment, used, cameras)


def _names(rng: np.random.Generator) -> list[str]:
    """The ring and three to eight other things, no two of a kind as long as there are others."""
    count = int(rng.integers(COUNT[0], COUNT[1] + 1)) - 1
    others = [str(name) for name in rng.permutation(sorted(THINGS))]
    # Animals come first in half of the places: they are what the reference scene shows.
    others.sort(key=lambda name: name not in ANIMALS and float(rng.random()) < 0.5)
    return [RING, *others[:count]]


def _arranged(rng: np.random.Generator, things: list[Mesh]) -> list[Mesh]:
    """The things turned and moved to where they do not meet; the first one, the ring, near the middle."""
    placed: list[Mesh] = []
    taken: list[tuple[float, float, float]] = []
    reach = float(rng.uniform(*REACH))
    for mesh in things:
        radius = float(np.linalg.norm(mesh.vertices[:, :2], axis=1).max())
        for tried in range(PLACES):
            # Farther and farther out, as the middle fills.
            widest = reach * (1.0 + tried / PLACES) if placed else 0.35 * reach
            away = widest * math.sqrt(rng.random())
            angle = rng.uniform(0, 2 * math.pi)
            x, y = away * math.cos(angle), away * math.sin(angle)
            if all(math.hypot(x - u, y - v) > radius + other + GAP for u, v, other in taken):
                break
        else:
            raise RejectedRoom("no place for a thing")
        taken.append((x, y, radius))
        placed.append(stand(mesh, (x, y, LIFT), float(rng.uniform(0, 2 * math.pi))))
    return placed


def _finishes(rng: np.random.Generator, count: int) -> list[str]:
    """Metal, coated and matt in turn, so that each is there, in random order."""
    return [str(name) for name in rng.permutation([FINISHES[k % len(FINISHES)] for k in range(count)])]


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(low * (high / low) ** rng.random())


def _ring_metal(rng: np.random.Generator) -> Material:
    return metal(finish=str(rng.choice(RING_FINISHES)), shade=1.0, alpha=_log_uniform(rng, *RING_ALPHA))


def _finished(rng: np.random.Generator, finish: str) -> Material:
    if finish == "metal":
        return metal(finish=str(rng.choice(METALS)), shade=1.0, alpha=_log_uniform(rng, *METAL_ALPHA))
    return paint(
        luminance=float(rng.uniform(0.12, 0.6)),
        chroma=float(rng.uniform(0.06, 0.16)),
        hue=float(rng.uniform(0, 2 * math.pi)),
        alpha=0.0 if finish == "matt" else _log_uniform(rng, *COAT_ALPHA),
    )


def _support(
    rng: np.random.Generator, support: str, things: list[Mesh], used: dict[str, Material]
) -> RoomObject:
    """The ground, or a table on a floor, with room for the things, which stand at z = 0."""
    if support == "ground":
        half = GROUND_SIZE / 2
        material = sample_material(rng, str(rng.choice(["floor", "stone", "paper"])))
        used[material.name] = material
        slab = box(-half, half, -half, half, -0.1, 0.0, bevel=0.004)
        return RoomObject("ground.0", "ground", {}, (0.0, 0.0, 0.0), 0.0, ((slab, material.name),))
    top = sample_material(rng, str(rng.choice(["wood", "lacquer", "stone"])))
    floor = sample_material(rng, "floor")
    used.update({top.name: top, floor.name: floor})
    half_x, half_y = np.max([np.abs(mesh.vertices[:, :2]).max(axis=0) for mesh in things], axis=0)
    x, y = float(half_x + rng.uniform(0.15, 0.4)), float(half_y + rng.uniform(0.1, 0.25))
    leg = cylinder(0.03, 0.0, TABLE_HEIGHT - 0.03 - LIFT, segments=32)
    legs = [
        stand(leg, (sx * (x - 0.09), sy * (y - 0.09), -TABLE_HEIGHT), 0.0) for sx in (-1, 1) for sy in (-1, 1)
    ]
    table = merge([rounded_box((-x, x, -y, y, -0.03, 0.0), 0.006), *legs])
    half = GROUND_SIZE / 2
    slab = box(-half, half, -half, half, -TABLE_HEIGHT - 0.1, -TABLE_HEIGHT - LIFT, bevel=0.004)
    shapes = ((table, top.name), (slab, floor.name))
    return RoomObject("table.0", "table", {}, (0.0, 0.0, 0.0), 0.0, shapes)
