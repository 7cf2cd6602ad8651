"""Furnished rooms, judged by their meshes and not by the boxes that placed them."""

import math
from itertools import combinations

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, label

from gibench.generators.light_shapes import light_mesh
from gibench.generators.visibility import RayCaster
from tests.generators.rooms_at_hand import INDICES, inside, joined, room, surface_points

SHELL = ("floor", "ceiling", "wall", "skirting", "door", "window")
TOLERANCE = 1e-3  # m
GAP = 5e-4  # most air under what stands on something, m


def furniture(a_room):
    return [thing for thing in a_room.objects if thing.family not in SHELL]


@pytest.mark.parametrize("index", INDICES)
def test_nothing_runs_into_anything(index):
    rng = np.random.default_rng(index)
    things = [(thing, *joined(thing)) for thing in room(index).objects]
    bounds = {thing.name: (v.min(0), v.max(0)) for thing, v, _ in things}
    for (a, av, af), (b, bv, bf) in combinations(things, 2):
        if a.family in SHELL and b.family in SHELL:
            continue
        low = np.maximum(bounds[a.name][0], bounds[b.name][0])
        high = np.minimum(bounds[a.name][1], bounds[b.name][1])
        if (high - low < TOLERANCE).any():
            continue
        for first, (v, f), (w, g) in ((a, (av, af), (bv, bf)), (b, (bv, bf), (av, af))):
            points = surface_points(rng, v, f, 3000, TOLERANCE)
            points = points[((points > low) & (points < high)).all(1)]
            if len(points):
                deep = inside(points, w, g)
                assert not deep.any(), (a.name, b.name, first.name, points[deep][0])


def test_sinking_by_three_millimetres_would_be_noticed():
    rng = np.random.default_rng(0)
    floor = joined(next(t for t in room(0).objects if t.family == "floor"))
    for thing in furniture(room(0)):
        vertices, faces = joined(thing)
        if vertices[:, 2].min() < 0.001:
            sunk = surface_points(rng, vertices - [0.0, 0.0, 0.003], faces, 3000, TOLERANCE)
            assert inside(sunk, *floor).any(), thing.name


@pytest.mark.parametrize("index", INDICES)
def test_nothing_floats(index):
    """Under or behind everything there is something that carries it, half a millimetre away at most."""
    a_room = room(index)
    meshes, owners = [], []
    for number, thing in enumerate(a_room.objects):
        meshes += [mesh for mesh, _ in thing.shapes]
        owners += [number] * len(thing.shapes)
    caster = RayCaster(meshes, owners)
    height = a_room.parameters["shell"]["height"]
    for number, thing in enumerate(a_room.objects):
        if thing.family in SHELL:
            continue
        vertices, _ = joined(thing)
        low, high = vertices[:, 2].min(), vertices[:, 2].max()
        if thing.family in ("pendant", "ceiling_panel", "downlight"):
            assert abs(height - high) < GAP, thing.name
        elif thing.family in ("picture", "mirror", "curtain", "wall_lamp", "wall_cupboard", "splashback"):
            walls = [
                np.asarray(m.vertices) for o in a_room.objects if o.family == "wall" for m, _ in o.shapes
            ]
            back = np.array([math.sin(thing.yaw), -math.cos(thing.yaw), 0.0])
            gaps = [abs((w @ back).min() - (vertices @ back).max()) for w in walls]
            assert min(gaps) < 0.07, thing.name
        else:
            feet = vertices[vertices[:, 2] < low + 1e-4]
            below = feet.mean(0) if len(feet) < 4 else feet[len(feet) // 2]
            origins = np.array([below - np.array([0.0, 0.0, 2e-5])])
            distance, owner = caster.cast(origins, np.array([[0.0, 0.0, -1.0]]))
            assert owner[0] != number
            assert distance[0] < GAP, (thing.name, a_room.objects[owner[0]].name, distance)


@pytest.mark.parametrize("index", INDICES)
def test_everything_is_inside(index):
    a_room = room(index)
    shell = a_room.parameters["shell"]
    for thing in furniture(a_room):
        vertices, _ = joined(thing)
        assert np.abs(vertices[:, 0]).max() < shell["width"] / 2 + 1e-6
        assert np.abs(vertices[:, 1]).max() < shell["depth"] / 2 + 1e-6
        assert vertices[:, 2].min() > -1e-6
        assert vertices[:, 2].max() < shell["height"] + 1e-6


def walkable(a_room, step=0.04, width=0.6):
    """Cells where a disk of that width fits, and a function from xy to cells. Rasterised from the meshes."""
    shell = a_room.parameters["shell"]
    w, d = shell["width"], shell["depth"]
    nx, ny = int(w / step), int(d / step)
    x, y = (np.arange(nx) + 0.5) * step - w / 2, (np.arange(ny) + 0.5) * step - d / 2
    origins = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
    origins = np.column_stack([origins, np.full(len(origins), 1.99)])
    meshes, owners = [], []
    for thing in a_room.objects:
        flat = thing.family in ("rug", "ceiling")
        meshes += [mesh for mesh, _ in thing.shapes]
        owners += [int(flat or thing.family == "floor")] * len(thing.shapes)
    distance, owner = RayCaster(meshes, owners).cast(origins, np.tile([0.0, 0.0, -1.0], (len(origins), 1)))
    blocked = ((owner != 1) | (distance < 1.9)).reshape(nx, ny)
    reach = int((width / 2 - step) / step)
    grid = np.arange(-reach, reach + 1)
    disk = grid[:, None] ** 2 + grid[None] ** 2 <= reach**2
    free = ~binary_dilation(np.pad(blocked, 1, constant_values=True), disk)[1:-1, 1:-1]

    def cell(p):
        return int((p[0] + w / 2) / step), int((p[1] + d / 2) / step)

    return free, cell


@pytest.mark.parametrize("index", INDICES)
def test_one_can_walk_from_the_door_to_every_camera(index):
    a_room = room(index)
    free, cell = walkable(a_room)
    regions, _ = label(free)
    door = next(o for o in a_room.objects if o.family == "door")
    vertices, _ = joined(door)
    middle = (vertices.min(0) + vertices.max(0))[:2] / 2
    shell = a_room.parameters["shell"]
    # Half a metre into the room from the door, whichever of the four ways that is.
    candidates = [middle + 0.5 * np.array(n) for n in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    inner = [
        c for c in candidates if abs(c[0]) < shell["width"] / 2 - 0.3 and abs(c[1]) < shell["depth"] / 2 - 0.3
    ]
    starts = {regions[cell(c)] for c in inner if free[cell(c)]}
    assert starts
    for camera in a_room.cameras:
        assert regions[cell(camera.position)] in starts


@pytest.mark.parametrize("index", INDICES)
def test_lamps_add_up_and_are_clear_of_geometry(index):
    a_room = room(index)
    assert 1499.0 <= sum(light.lumens for light in a_room.lights) <= 6001.0
    meshes, owners = [], []
    for number, thing in enumerate(a_room.objects):
        meshes += [mesh for mesh, _ in thing.shapes]
        owners += [number] * len(thing.shapes)
    caster = RayCaster(meshes, owners)
    shell = a_room.parameters["shell"]
    reached = 0
    for light in a_room.lights:
        glow = light_mesh(light)
        assert np.abs(glow.vertices[:, 0]).max() < shell["width"] / 2
        assert np.abs(glow.vertices[:, 1]).max() < shell["depth"] / 2
        assert glow.vertices[:, 2].min() > 0
        assert glow.vertices[:, 2].max() < shell["height"]
        if light.shape == "sphere":
            # From the centre outwards nothing comes before the surface of the bulb.
            rays = np.array(
                [[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z]
            )
            rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
            distance, _ = caster.cast(np.tile(light.centre, (len(rays), 1)), rays)
            assert distance.min() > light.size[0] - 1e-4, light.name
        else:
            spread = np.array([light.direction, *(np.asarray(light.direction) + 0.7 * e for e in np.eye(3))])
            rays = spread / np.linalg.norm(spread, axis=1, keepdims=True)
            distance, _ = caster.cast(np.tile(light.centre, (len(rays), 1)), rays)
        reached += distance.max() > 0.5
    assert reached >= 1


def test_rooms_look_lived_in():
    for index in INDICES:
        a_room = room(index)
        assert len(furniture(a_room)) >= 12
        families = {thing.family for thing in furniture(a_room)}
        assert len(families) >= 7
    everywhere = {thing.family for index in INDICES for thing in furniture(room(index))}
    assert len(everywhere) >= 30


def test_the_kind_of_room_shows():
    needed = {
        "living": {"sofa"},
        "bedroom": {"bed"},
        "dining-kitchen": {"kitchen_counter", "dining_table", "chair"},
        "office": {"desk", "office_chair"},
        "bathroom": {"bathtub", "washbasin"},
    }
    for index in INDICES:
        a_room = room(index)
        assert needed[a_room.kind] <= {thing.family for thing in a_room.objects}


def test_chairs_face_a_table():
    for index in INDICES:
        a_room = room(index)
        tables = [t for t in a_room.objects if t.family in ("dining_table", "desk")]
        for chair in a_room.objects:
            if chair.family == "chair" and tables:
                ahead = np.array([-math.sin(chair.yaw), math.cos(chair.yaw)])
                ways = [np.subtract(t.position[:2], chair.position[:2]) for t in tables]
                nearest = min(ways, key=lambda v: float(np.linalg.norm(v)))
                assert ahead @ nearest / np.linalg.norm(nearest) > 0.4, (index, chair.name)
