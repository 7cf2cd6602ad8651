"""Stills along trajectories and away from them: how many, in which order, how near and how far."""

import math
from collections import Counter

import numpy as np
import pytest

from gibench.generators.parts import Camera
from gibench.generators.rooms import sample_room
from gibench.generators.trajectories import FAR, NoFarView, Spread, differences, spread_stills


def camera(x, yaw=0.0, path="walk", step=0):
    return Camera((x, 0.0, 1.0), (x + 2 * math.cos(yaw), 2 * math.sin(yaw), 1.0), 1.0, path, step)


def walk(frames):
    return [camera(0.01 * step, step=step) for step in range(frames)], Counter(bend=1)


def test_differences_are_half_the_distance_and_the_angle():
    found = differences(camera(0), [camera(0), camera(3), camera(0, math.pi / 2), camera(1, -math.pi)])
    np.testing.assert_allclose(found, [0, 1.5, math.pi / 2, 0.5 + math.pi], atol=1e-7)
    longer = Camera((0, 0, 1), (9, 0, 1), 1.0)  # how far off the target is does not count
    np.testing.assert_allclose(differences(longer, [camera(0, 0.3)]), [0.3])
    assert differences(camera(0), []).shape == (0,)


def test_the_order_of_stills():
    offered = iter([[camera(0.1), camera(5)], [camera(9)]])
    made, refused = spread_stills(20, Spread(3, 6, 2), walk, lambda: (next(offered), Counter()))
    assert len(made) == 20
    assert all(one.path == "" and one.step == 0 for one in made[:18])
    assert [one.position[0] for one in made[18:]] == [5, 9]
    assert refused == {"bend": 3, "near a trajectory": 1}
    # The four between lie evenly along the 18 on trajectories of six each, and are none of those to train on.
    steps = [round(100 * one.position[0]) for one in made[:18]]
    assert steps[14:] == [2, 0, 5, 3]
    assert Counter(steps) == Counter(dict.fromkeys(range(6), 3))


def test_more_trajectories_than_stills_and_none_that_are_held_out():
    made, _ = spread_stills(2, Spread(5), walk, lambda: ([], Counter()))
    assert len(made) == 2


def test_trajectories_that_go_everywhere():
    with pytest.raises(NoFarView):
        spread_stills(3, Spread(1, 1, 1), walk, lambda: ([camera(0.1)], Counter()))


def test_far_stills_lie_away_from_other_cameras_too():
    offered = iter([[camera(5)], [camera(9)]])
    made, _ = spread_stills(
        3, Spread(1, 1, 1), walk, lambda: (next(offered), Counter()), [camera(5.5, path="")]
    )
    assert made[-1].position[0] == 9


@pytest.mark.parametrize("kind", ["still-life", "living"])
def test_real_scenes(kind):
    """Views that are held out on trajectories of 50 views lie close to others, far ones do not."""
    spread = Spread(4, 20, 10)
    room = sample_room(4, 1, kind=kind, views=210, spread=spread)
    to_train, near, far = room.cameras[:190], room.cameras[190:200], room.cameras[200:]
    assert max(differences(one, to_train).min() for one in near) < 0.25
    assert min(differences(one, (*to_train, *near)).min() for one in far) >= FAR
    assert sample_room(4, 1, kind=kind, views=210, spread=spread).cameras == room.cameras
