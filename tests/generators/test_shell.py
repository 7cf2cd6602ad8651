import math

import numpy as np
import pytest

from gibench.generators.openings import ARCHITRAVE
from gibench.generators.parts import Mesh
from gibench.generators.shell import SLAB, build_shell, footprint_corners
from gibench.generators.shell_sampling import MIN_LEG, SIZES, sample_shell
from gibench.generators.visibility import RayCaster
from tests.generators.rooms_at_hand import directed_edges_cancel, joined, volume

DOOR = {"wall": 0, "kind": "door", "s0": 0.5, "s1": 1.4, "z0": 0.0, "z1": 2.05}
WINDOW = {"wall": 1, "kind": "window", "s0": 1.0, "s1": 2.5, "z0": 0.9, "z1": 2.1, "style": (2, 2)}


def shell_with(*openings, notch=None, width=4.0, depth=5.0, height=2.6):
    return build_shell(
        width=width,
        depth=depth,
        height=height,
        notch=notch,
        wall_thickness=0.2,
        skirting=(0.08, 0.015),
        openings=openings or (DOOR,),
    )


def caster(shell):
    meshes = [part.mesh for piece in shell.pieces for part in piece.parts]
    owners = [number for number, piece in enumerate(shell.pieces) for _ in piece.parts]
    return RayCaster(meshes, owners)


def random_rays(rng, shell, count):
    low, high = shell.footprint.min(0), shell.footprint.max(0)
    xy = rng.uniform(low + 0.05, high - 0.05, (4 * count, 2))
    if shell.notch is not None:
        x0, y0, x1, y1 = shell.notch
        within = (
            (xy[:, 0] > x0 - 0.05) & (xy[:, 0] < x1 + 0.05) & (xy[:, 1] > y0 - 0.05) & (xy[:, 1] < y1 + 0.05)
        )
        xy = xy[~within]
    origins = np.column_stack([xy[:count], rng.uniform(0.05, shell.height - 0.05, count)])
    directions = rng.normal(size=(count, 3))
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def all_shells():
    yield "box", shell_with(DOOR, WINDOW)
    for corner in range(4):
        yield f"L{corner}", shell_with(DOOR | {"wall": 5 if corner < 2 else 0}, notch=(corner, 1.2, 1.6))
    for seed in range(8):
        yield f"sampled {seed}", sample_shell(np.random.default_rng(seed), ("living", "bathroom")[seed % 2])


@pytest.mark.parametrize(("name", "shell"), list(all_shells()))
def test_every_piece_is_closed(name, shell):
    for piece in shell.pieces:
        for part in piece.parts:
            assert directed_edges_cancel(part.mesh), (name, piece.name, part.slot)
            assert volume(part.mesh.vertices, part.mesh.faces) > 0
            lengths = np.linalg.norm(part.mesh.normals, axis=1)
            np.testing.assert_allclose(lengths, 1, atol=1e-12)
            a, b, c = (part.mesh.vertices[part.mesh.faces[:, k]] for k in range(3))
            agree = np.einsum("ij,ij->i", np.cross(b - a, c - a), part.mesh.normals[part.mesh.faces[:, 0]])
            assert (agree > 0).all()


@pytest.mark.parametrize("notch", [None, (0, 1.2, 1.6), (1, 1.2, 1.6), (2, 1.2, 1.6), (3, 1.2, 1.6)])
def test_footprint_runs_counter_clockwise_around_the_right_area(notch):
    corners = footprint_corners(4.0, 5.0, notch)
    x, y = corners.T
    area = 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))
    assert area == pytest.approx(20.0 - (0.0 if notch is None else 1.2 * 1.6))
    np.testing.assert_array_equal([corners.min(0), corners.max(0)], [[-2, -2.5], [2, 2.5]])


@pytest.mark.parametrize("notch", [None, (0, 1.2, 1.6), (2, 1.5, 1.1)])
def test_no_light_enters_a_room_without_windows(notch):
    shell = shell_with(DOOR | {"wall": 5 if notch and notch[0] < 2 else 0}, notch=notch)
    rng = np.random.default_rng(5)
    cast = caster(shell).cast
    origins, directions = random_rays(rng, shell, 20_000)
    _, owner = cast(origins, directions)
    assert (owner >= 0).all()
    # Rays into the corners and edges, where walls, floor and ceiling meet.
    targets = [[*corner, z] for corner in shell.footprint for z in (0.0, 1.0, shell.height)]
    for target in targets:
        aimed = np.asarray(target) + rng.normal(scale=1e-4, size=(len(origins[:500]), 3)) - origins[:500]
        aimed /= np.linalg.norm(aimed, axis=1, keepdims=True)
        _, owner = cast(origins[:500], aimed)
        assert (owner >= 0).all()


def test_light_leaves_through_the_window_alone():
    shell = shell_with(DOOR, WINDOW)
    rng = np.random.default_rng(6)
    origins, directions = random_rays(rng, shell, 60_000)
    distance, owner = caster(shell).cast(origins, directions)
    lost = owner < 0
    assert 0.003 < lost.mean() < 0.1
    assert np.isinf(distance[lost]).all()
    wall = shell.walls[WINDOW["wall"]]
    away = (origins[lost][:, :2] - wall.start) @ wall.inward
    towards = -(directions[lost][:, :2] @ wall.inward)
    exits = origins[lost] + directions[lost] * (away / towards)[:, None]
    s = (exits[:, :2] - wall.start) @ wall.along
    assert (towards > 0).all()
    assert (s > WINDOW["s0"]).all()
    assert (s < WINDOW["s1"]).all()
    assert (exits[:, 2] > WINDOW["z0"]).all()
    assert (exits[:, 2] < WINDOW["z1"]).all()


@pytest.mark.parametrize("notch", [None, (2, 1.2, 1.6)])
def test_all_light_that_leaves_passes_through_the_window_rectangles(notch):
    walls = range(4 if notch is None else 6)
    windows = [WINDOW | {"wall": wall, "s0": 0.4, "s1": 0.9} for wall in walls]
    shell = shell_with(DOOR | {"s0": 1.2, "s1": 2.0}, *windows, notch=notch)
    origins, directions = random_rays(np.random.default_rng(7), shell, 60_000)
    _, owner = caster(shell).cast(origins, directions)
    origins, directions = origins[owner < 0], directions[owner < 0]
    passed = np.zeros(len(origins), dtype=int)
    for corner, u, v in shell.window_rectangles:
        normal = np.cross(u, v)
        distance = ((corner - origins) @ normal) / (directions @ normal)
        at = origins + distance[:, None] * directions - corner
        a, b = at @ u / (u @ u), at @ v / (v @ v)
        passed += (distance > 0) & (directions @ normal < 0) & (abs(a - 0.5) <= 0.5) & (abs(b - 0.5) <= 0.5)
    assert len(origins) > 300
    assert (passed >= 1).all()
    assert len(shell.window_rectangles) == len(windows)


def test_inner_size_is_the_sampled_one():
    shell = shell_with(DOOR, width=4.4, depth=5.2, height=2.7)
    directions = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    distance, _ = caster(shell).cast(np.tile([0.0, 0.0, 1.0], (6, 1)), directions)
    np.testing.assert_allclose(distance[:4], [2.2, 2.2, 2.6, 2.6], atol=1e-5)
    np.testing.assert_allclose(distance[4:], [1.7, 1.0], atol=1e-5)


def test_door_stands_in_a_recess():
    shell = shell_with(DOOR)
    wall = shell.walls[0]
    x, y = wall.point((DOOR["s0"] + DOOR["s1"]) / 2, 1.0)
    distance, owner = caster(shell).cast(np.array([[x, y, 1.5]]), -np.array([[*wall.inward, 0.0]]))
    assert shell.pieces[owner[0]].name == "door"
    assert 1.0 < distance[0] < 1.06


def test_skirting_leaves_the_door_out():
    shell = shell_with(DOOR)
    wall = shell.walls[0]
    low = np.array([[*wall.point(s, 0.5), 0.03] for s in np.linspace(0.05, wall.length - 0.05, 200)])
    _, owner = caster(shell).cast(low, np.tile([*-wall.inward, 0.0], (200, 1)))
    names = np.array([shell.pieces[k].name for k in owner])
    s = np.linspace(0.05, wall.length - 0.05, 200)
    at_door = (s > DOOR["s0"] - ARCHITRAVE) & (s < DOOR["s1"] + ARCHITRAVE)
    assert set(names[at_door]) <= {"door", "wall.0"}  # the wall of the recess shows beside the leaf
    assert (names[~at_door] == "skirting").all()


def test_slabs_reach_under_the_walls():
    shell = shell_with(DOOR)
    for name, z in (("floor", (-SLAB, 0.0)), ("ceiling", (2.6, 2.6 + SLAB))):
        piece = next(p for p in shell.pieces if p.name == name)
        vertices = piece.parts[0].mesh.vertices
        np.testing.assert_allclose(vertices.min(0), [-2.2, -2.7, z[0]], atol=1e-12)
        np.testing.assert_allclose(vertices.max(0), [2.2, 2.7, z[1]], atol=1e-12)


def test_sampled_sizes_keep_their_bounds_and_spread():
    shells = [sample_shell(np.random.default_rng(k), "living").parameters for k in range(200)]
    for name, (mean, deviation, least, greatest) in SIZES.items():
        values = np.array([s[name] for s in shells])
        assert values.min() >= least
        assert values.max() <= greatest
        assert abs(values.mean() - mean) < 0.6 * deviation
        assert len(np.unique(values)) == len(values)
    notches = [s["notch"] for s in shells if s["notch"]]
    assert 15 < len(notches) < 100
    for s in shells:
        if s["notch"]:
            assert s["width"] - s["notch"][1] >= MIN_LEG - 1e-9
            assert s["depth"] - s["notch"][2] >= MIN_LEG - 1e-9


def test_openings_keep_to_their_walls():
    windows = 0
    for seed in range(60):
        shell = sample_shell(np.random.default_rng(seed), "office")
        for hole in shell.openings:
            wall = shell.walls[hole.wall]
            assert 0.25 < hole.s0 < hole.s1 < wall.length - 0.25
            assert hole.z1 < shell.height
            for other in shell.openings:
                if other is not hole and other.wall == hole.wall:
                    assert hole.s1 < other.s0 or other.s1 < hole.s0
        assert sum(o.kind == "door" for o in shell.openings) == 1
        windows += bool(shell.windows)
    assert windows > 56


def test_building_again_gives_the_same():
    shell = sample_shell(np.random.default_rng(3), "living")
    again = build_shell(**shell.parameters)
    for piece, other in zip(shell.pieces, again.pieces, strict=True):
        a, b = (
            joined(type("Thing", (), {"shapes": [(p.mesh, "") for p in q.parts]})) for q in (piece, other)
        )
        np.testing.assert_array_equal(a[0], b[0])


def test_wall_frame():
    shell = shell_with(DOOR)
    for wall in shell.walls:
        x, y = wall.point(wall.length, 0.0)
        assert math.dist((x, y), wall.end) < 1e-12
        assert np.dot(wall.inward, -np.asarray(wall.start)) > 0
        assert np.cross([*wall.along, 0], [*wall.inward, 0])[2] == pytest.approx(1.0)


def test_meshes_hold_the_types_of_the_contract():
    for piece in shell_with(DOOR, WINDOW).pieces:
        for part in piece.parts:
            mesh: Mesh = part.mesh
            assert mesh.faces.dtype == np.int32
            assert mesh.vertices.shape == mesh.normals.shape
            assert mesh.uvs.shape == (len(mesh.vertices), 2)
