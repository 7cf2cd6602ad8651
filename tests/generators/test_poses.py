import math

import numpy as np
import pytest

from gibench.generators.grid_solid import box
from gibench.generators.poses import facing_yaw, stand, turn


def test_quarter_turns_are_exact():
    point = np.array([0.1, 0.7, 0.3])
    np.testing.assert_array_equal(turn(point, math.pi / 2), [-0.7, 0.1, 0.3])
    np.testing.assert_array_equal(turn(turn(point, -math.pi / 2), math.pi / 2), point)


@pytest.mark.parametrize("angle", [0.3, -2.0, 7.0])
def test_turning_is_rotation(angle):
    matrix = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    points = np.random.default_rng(0).normal(size=(5, 2))
    np.testing.assert_allclose(turn(points, angle), points @ matrix.T, atol=1e-12)


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, -1.0), (-0.6, 0.8)])
def test_front_faces_the_direction(direction):
    np.testing.assert_allclose(turn(np.array([0.0, 1.0]), facing_yaw(direction)), direction, atol=1e-12)


def test_standing_keeps_shape():
    mesh = stand(box((0, 0, 0), (1, 2, 3)), (5.0, 6.0, 7.0), math.pi / 2)
    np.testing.assert_array_equal(mesh.vertices.min(0), [3.0, 6.0, 7.0])
    np.testing.assert_array_equal(mesh.vertices.max(0), [5.0, 7.0, 10.0])
