import math

import numpy as np
import pytest

from gibench.generators.parts import Camera
from gibench.generators.view_checks import GRID, camera_rays, check_views

EAST = Camera((0.0, 0.0, 1.5), (1.0, 0.0, 1.5), math.radians(90))


class Scripted:
    """A caster that answers what a test has written down."""

    def __init__(self, distance, owner):
        self.distance, self.owner = np.asarray(distance, np.float32), np.asarray(owner)

    def cast(self, origins, directions):
        assert len(origins) == len(directions) == len(self.distance)
        return self.distance, self.owner


def good_view():
    """Ten things at distances from 1 to 4 m, none of them large."""
    count = GRID[0] * GRID[1]
    owner = np.arange(count) % 10
    return 1.0 + owner / 3.0, owner


def reason(distance, owner, shell_owners=2):
    return check_views(Scripted(distance, owner), [EAST], shell_owners)[0].reason


def test_rays_span_the_field_of_view():
    rays = camera_rays([EAST], (400, 300))[0]
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1)
    grid = rays.reshape(300, 400, 3)
    across = np.degrees(np.arctan2(-grid[150, :, 1], grid[150, :, 0]))
    assert across[0] == pytest.approx(-45, abs=0.2)
    assert across[-1] == pytest.approx(45, abs=0.2)
    assert grid[0, 200, 2] > 0 > grid[-1, 200, 2]
    assert grid[0, 200, 2] / grid[0, 200, 0] == pytest.approx(0.75, abs=0.01)


@pytest.mark.parametrize("towards", [-1, 1])
def test_a_view_along_z_has_rays_and_a_verdict(towards):
    along = Camera((0, 0, 1), (0, 0, 1 + towards), math.radians(90))
    rays = camera_rays([along])[0]
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1)
    assert (rays[:, 2] * towards > 0).all()
    assert check_views(Scripted(*good_view()), [along], 2)[0].reason == ""


def test_a_good_view_passes():
    view = check_views(Scripted(*good_view()), [EAST], 2)[0]
    assert view.reason == ""
    assert view.objects == 8


def test_rays_of_many_cameras_are_unit_and_each_its_own():
    other = Camera((1.0, 2.0, 1.5), (0.0, 0.0, 1.0), 0.9)
    rays = camera_rays([EAST, other])
    np.testing.assert_allclose(np.linalg.norm(rays, axis=2), 1.0)
    np.testing.assert_allclose(rays[1], camera_rays([other])[0])
    assert not np.allclose(rays[0], rays[1])


def test_many_candidates_are_judged_each_on_its_own():
    distance, owner = good_view()
    close = distance.copy()
    close[17] = 0.49
    views = check_views(
        Scripted(np.concatenate([distance, close]), np.concatenate([owner, owner])), [EAST, EAST], 2
    )
    assert [v.reason for v in views] == ["", "too close"]


def test_reasons():
    distance, owner = good_view()
    assert reason(np.full_like(distance, 2.0) + 0.01 * owner, owner) == "flat depth"
    assert reason(distance * 8, owner) == "mean depth"
    few = owner.copy()
    few[few >= 6] = 0
    assert reason(distance, few) == "few objects"
    assert reason(distance, np.where(np.arange(len(owner)) < 0.55 * len(owner), 3, owner)) == "one surface"
    lost = owner.copy()
    lost[: int(0.4 * len(owner))] = -1
    assert reason(np.where(lost < 0, np.inf, distance), lost) == "looks outside"
    little = owner.copy()
    little[:20] = -1
    assert reason(np.where(little < 0, np.inf, distance), little) == ""
