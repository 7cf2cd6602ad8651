import math

import numpy as np
import pytest

from gibench.generators.layouts.placement import LIFT, FloorPlan, RejectedRoom, required
from gibench.generators.layouts.relations import (
    above,
    against_wall,
    around,
    beside,
    facing,
    hang,
    in_corner,
    in_front,
    lay_rug,
    on_top,
)
from gibench.generators.layouts.solids import rectangle
from gibench.generators.parts import Furniture, Part, Support
from gibench.generators.poses import turn
from gibench.generators.shapes import box
from gibench.generators.shell import build_shell

DOOR = {"wall": 0, "kind": "door", "s0": 0.5, "s1": 1.4, "z0": 0.0, "z1": 2.05}
WINDOW = {"wall": 2, "kind": "window", "s0": 1.0, "s1": 2.5, "z0": 0.9, "z1": 2.1}


@pytest.fixture
def plan():
    shell = build_shell(
        width=4.0,
        depth=5.0,
        height=2.6,
        notch=None,
        wall_thickness=0.2,
        skirting=(0.08, 0.015),
        openings=(DOOR, WINDOW),
    )
    return FloorPlan(shell, "living", np.random.default_rng(0))


def block(family, width, depth, height, mount="floor", supports=()):
    mesh = box(-width / 2, width / 2, -depth / 2, depth / 2, 0.0, height)
    return Furniture(family, {}, (Part(mesh, "wood"),), supports, mount=mount)


def front(thing):
    return turn(np.array([0.0, 1.0]), thing.yaw)


def test_against_a_wall_the_front_looks_into_the_room(plan):
    for index, wall in enumerate(plan.shell.walls):
        thing = against_wall(plan, block("dresser", 0.6, 0.4, 0.8), walls=[index], tries=40)
        np.testing.assert_allclose(front(thing), wall.inward, atol=1e-12)
        away = np.dot(np.subtract(thing.position[:2], wall.start), wall.inward)
        assert 0.2 + plan.shell.skirting_depth < away < 0.26
        assert thing.position[2] == pytest.approx(LIFT)


def test_the_door_stays_free(plan):
    door = plan.shell.walls[0].point(0.95, 0.5)
    assert plan.put(block("dresser", 0.5, 0.5, 1.0), door, 0.0) is None
    assert plan.put(block("rug", 0.5, 0.5, 0.01), door, 0.0, z=LIFT) is not None


def test_nothing_tall_stands_before_a_window(plan):
    window = plan.shell.walls[2].point(1.7, 0.25)
    assert plan.put(block("wardrobe", 0.4, 0.3, 2.0), window, math.pi) is None
    assert plan.put(block("dresser", 0.4, 0.3, 0.8), window, math.pi) is not None


def test_things_keep_apart(plan):
    assert plan.put(block("a", 1.0, 1.0, 1.0), (0.0, 0.5), 0.0) is not None
    assert plan.put(block("b", 1.0, 1.0, 1.0), (0.99, 0.5), 0.0) is None
    assert plan.put(block("b", 1.0, 1.0, 1.0), (1.003, 0.5), 0.0) is None
    assert plan.put(block("b", 1.0, 1.0, 1.0), (1.006, 0.5), 0.0) is not None


def test_zones_bar_all_but_the_named(plan):
    zone = rectangle(0.0, 1.0, 0.5, 0.5, 0.0, 0.03, 1.6)
    plan.keep_free(zone, ("chair",))
    assert plan.put(block("dresser", 0.4, 0.4, 0.8), (0.0, 1.0), 0.0) is None
    assert plan.put(block("chair", 0.4, 0.4, 0.8), (0.0, 1.0), 0.0) is not None


def test_a_rug_lifts_what_stands_on_it(plan):
    rug = lay_rug(plan, block("rug", 2.0, 1.4, 0.012), (0.0, 0.8), 0.0)
    on = plan.put(block("coffee_table", 0.8, 0.6, 0.4), (0.0, 0.8), 0.0)
    assert on.position[2] - rug.top == pytest.approx(LIFT)
    assert plan.put(block("sofa", 1.6, 0.5, 0.8), (0.0, 1.4), 0.0) is None, "half on, half off"
    assert plan.put(block("sofa", 1.6, 0.5, 0.8), (0.0, 1.8), 0.0).position[2] == pytest.approx(LIFT)


def test_on_top_stands_on_the_support_and_within_it(plan):
    support = Support(-0.4, 0.4, -0.2, 0.2, 0.75, 0.5)
    table = plan.put(block("dresser", 1.0, 0.5, 0.75, supports=(support,)), (0.3, 0.9), 0.4)
    for _ in range(6):
        thing = on_top(plan, block("vase", 0.1, 0.06, 0.3, "surface"), table)
        if thing is None:
            continue
        assert thing.position[2] - (table.position[2] + 0.75) == pytest.approx(LIFT)
        local = turn(np.subtract(thing.position[:2], table.position[:2]), -table.yaw)
        assert np.abs(local[0]) < 0.4 - 0.03
        assert np.abs(local[1]) < 0.2 - 0.03
    assert len(plan.of("vase")) >= 3
    assert on_top(plan, block("vase", 0.1, 0.1, 0.6, "surface"), table) is None, "too tall for the clearance"
    assert on_top(plan, block("box", 0.9, 0.1, 0.1, "surface"), table, yaw=0.0) is None, "too long"


def test_around_a_table_chairs_face_it(plan):
    table = plan.put(block("dining_table", 1.6, 0.9, 0.75), (0.2, 0.7), math.pi / 2)
    chairs = around(plan, [block("chair", 0.45, 0.5, 0.9)] * 4, table, tuck=0.2)
    assert len(chairs) >= 3
    for chair in chairs:
        towards = np.subtract(table.position[:2], chair.position[:2])
        assert front(chair) @ towards / np.linalg.norm(towards) > 0.75


def test_in_front_beside_and_facing(plan):
    sofa = plan.put(block("sofa", 2.0, 0.9, 0.8), (0.0, 1.9), math.pi)
    table = in_front(plan, block("coffee_table", 1.0, 0.5, 0.4), sofa, 0.4)
    np.testing.assert_allclose(table.position[:2], [0.0, 1.9 - 0.45 - 0.4 - 0.25], atol=1e-9)
    np.testing.assert_allclose(front(table), -front(sofa), atol=1e-9)
    lamp = beside(plan, block("floor_lamp", 0.3, 0.3, 1.6), sofa, -1, 0.1)
    assert lamp.position[0] == pytest.approx(1.25)
    assert lamp.position[1] == pytest.approx(1.9 + 0.45 - 0.15)
    seat = facing(plan, block("armchair", 0.8, 0.8, 0.8), table, math.pi / 2, 0.2)
    towards = np.subtract(table.position[:2], seat.position[:2])
    np.testing.assert_allclose(front(seat), towards / np.linalg.norm(towards), atol=1e-9)


def test_hanging(plan):
    picture = block("picture", 0.6, 0.03, 0.5, "wall")
    wall = plan.shell.walls[1]
    hung = hang(plan, picture, wall, 2.0, 1.3)
    away = np.dot(np.subtract(hung.position[:2], wall.start), wall.inward)
    assert 0.015 < away < 0.0165
    assert hang(plan, picture, wall, 2.3, 1.3) is None, "another picture is there"
    window = plan.shell.walls[2]
    assert hang(plan, picture, window, 1.5, 1.3) is None, "a window is there"
    assert hang(plan, picture, plan.shell.walls[0], 1.0, 1.3) is None, "the door is there"
    low = against_wall(plan, block("dresser", 1.0, 0.4, 0.8), walls=[3])
    over = above(plan, picture, low, 0.2)
    assert over.position[2] == pytest.approx(low.top + 0.2)


def test_in_corner_looks_to_the_middle(plan):
    plant = in_corner(plan, block("plant", 0.4, 0.4, 1.0))
    assert front(plant) @ -np.asarray(plant.position[:2]) > 0


def test_free_floor_is_what_can_be_reached(plan):
    whole = plan.free_floor()
    assert whole.area == pytest.approx(3.4 * 4.4, rel=0.01)
    # A barrier with a gap of 0.5 m lets nobody through, one of 0.7 m does.
    plan.put(block("shelf", 3.4, 0.3, 1.0), (-0.25, 0.0), 0.0)
    assert plan.free_floor().bounds[3] < 0.0
    plan.placed.clear()
    plan.put(block("bed", 3.2, 0.3, 1.0), (-0.35, 1.0), 0.0)
    assert plan.free_floor().bounds[3] > 2.0


def test_required():
    with pytest.raises(RejectedRoom, match="no place for a sofa") as caught:
        required(None, "a sofa")
    assert caught.value.reason == "no place for a sofa"
