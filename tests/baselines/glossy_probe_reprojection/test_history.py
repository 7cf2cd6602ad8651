"""What the frame before stands in for."""

from __future__ import annotations

import mitsuba as mi
import numpy as np

from gibench.baselines.glossy_probe_reprojection.history import PastFrame, recalled
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.replay import camera_arrays
from tests.baselines.efficient_light_probes.test_search import floor, rays
from tests.baselines.probes.test_mappings import columns

SIZE = (32, 24)
BEFORE = PinholeCamera((0.0, -2.0, 2.5), (0.0, 0.2, 0.0), 1.0)
NOW = PinholeCamera((0.2, -1.9, 2.4), (0.1, 0.2, 0.0), 1.0)


def vectors(kind, values):
    return kind(np.ascontiguousarray(np.asarray(values, dtype=np.float32).T))


def painted(points):
    return np.stack([np.sin(points[:, 0]), np.cos(points[:, 1]), 1 + points[:, 0]], axis=1)


def recall(lift=0.0, material=1, known=True):
    """Colors for the pixels of NOW, whether they were seen, and what they should be."""
    points = floor(*rays(BEFORE, SIZE))[0]
    count = len(points)
    frame = PastFrame(
        camera_arrays(BEFORE, SIZE),
        *(mi.Int32(side) for side in SIZE),
        vectors(mi.Color3f, painted(points)),
        vectors(mi.Point3f, points),
        mi.UInt32(np.full(count, 1)),
        mi.Bool(np.full(count, known)),
    )
    now = floor(*rays(NOW, SIZE))[0]
    color, there = recalled(
        frame,
        vectors(mi.Point3f, now + np.array([0, 0, lift])),
        mi.UInt32(np.full(count, material)),
        mi.Bool(np.ones(count, dtype=bool)),
    )
    x, y, _ = BEFORE.project(now, SIZE)
    inside = (x > 0) & (x < SIZE[0]) & (y > 0) & (y < SIZE[1])
    return columns(color), np.array(there), painted(now), inside


def test_points_have_the_color_that_they_had():
    """To within half a pixel: 13 cm of the floor at most, over which colors change by as much."""
    color, there, expected, inside = recall()
    np.testing.assert_array_equal(there, inside)
    assert 0.5 < there.mean() < 1
    np.testing.assert_allclose(color[there], expected[there], atol=0.15)
    assert not color[~there].any()


def test_nothing_is_recalled_of_other_points_materials_or_what_was_not_known():
    for given in ({"lift": 0.8}, {"material": 2}, {"known": False}):
        color, there, _, _ = recall(**given)
        assert not there.any()
        assert not color.any()
