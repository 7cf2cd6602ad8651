"""The share of light samples that goes through the windows: its moments are closed forms, and the sun closes them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gibench.rendering.portal_share import DARK, SHARES, portal_share, relative_noise
from gibench.rendering.scene import load_dict
from tests.rendering import test_portals
from tests.rendering.scenes import rgb


def under(sky):
    """The room of `test_portals` without its lamp, under a sky of (8, 16, 3) pixels."""
    import mitsuba as mi

    description = {name: thing for name, thing in test_portals.room().items() if name != "lamp"}
    description["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(sky.astype(np.float32))}
    return replace(load_dict(description), openings=test_portals.OPENINGS_OF_ROOM)


def test_a_sky_alone_is_seen_through_the_windows_and_a_high_sun_is_not():
    even = np.full((8, 16, 3), 1.0)
    assert float(under(even).portals.fraction[0]) >= 0.25
    # Nearly all light comes from one direction through the skylight, which the environment itself finds.
    sun = np.full((64, 128, 3), 1e-4)
    sun[31:33, 63:65] = 5000.0  # along z; Y is up in the panorama
    assert under(sun).portals is None
    # A sun behind a wall takes all samples of the environment for nothing.
    behind = np.full((64, 128, 3), 0.5)
    behind[1, :2] = 5000.0
    assert float(under(behind).portals.fraction[0]) >= 0.25


def test_a_gap_in_a_closed_room_is_seen_through():
    """Three in a thousand directions lead through it; all else that is sampled meets a wall."""
    from gibench.stress.lights import behind_a_gap
    from gibench.stress.scenes import constant

    gap = np.array([[[-0.5, -0.005, 1.0], [0.0, 0.01, 0.0], [1.0, 0.0, 0.0]]])
    scene = replace(behind_a_gap(sky=constant(10.0)), openings=gap)
    assert float(scene.portals.fraction[0]) == SHARES[-1]


@pytest.mark.parametrize("black", [True, False])
def test_no_light_from_outside_is_no_use_of_portals(black):
    if black:
        assert under(np.zeros((8, 16, 3))).portals is None
        return
    scene = replace(load_dict(test_portals.room(environment=False)), openings=test_portals.OPENINGS_OF_ROOM)
    assert scene.portals is None


def test_it_is_the_same_whatever_the_threads():
    import drjit as dr

    from gibench.rendering import portal_share as module
    from gibench.rendering.portals import Portals

    scene = load_dict(test_portals.room())
    portals = Portals(scene.mi_scene, test_portals.OPENINGS_OF_ROOM)
    first = relative_noise(*module._points(scene.mi_scene, portals))
    threads = dr.thread_count()
    dr.set_thread_count(1)
    try:
        np.testing.assert_array_equal(relative_noise(*module._points(scene.mi_scene, portals)), first)
    finally:
        dr.set_thread_count(threads)
    assert portal_share(scene.mi_scene, portals) in SHARES


def test_moments_are_those_of_the_density_that_is_judged():
    """Two directions of known densities: the second moment of each share by hand."""
    rest, by_portal, radiance, no_bounce = (
        np.array([0.8, 0.2]),
        np.array([0.1, 0.9]),
        np.array([1.0, 3.0]),
        0.0,
    )
    # As many points as each direction is drawn, with half of the samples through portals.
    drawn = 0.5 * rest + 0.5 * by_portal
    counts = np.rint(drawn * 1000).astype(int)
    columns = [np.repeat(x, counts) for x in (radiance, rest, by_portal, np.full(2, no_bounce), drawn)]
    none = np.zeros((5, counts.sum()))
    found = relative_noise(np.zeros(counts.sum(), dtype=np.int64), np.array(columns), none)
    mean = radiance.sum()
    for share, moment in zip(SHARES, found, strict=True):
        density = (1 - share) * rest + share * by_portal
        assert moment == pytest.approx((radiance**2 / density).sum() / (mean**2 * (1 + DARK)))
    assert (
        relative_noise(np.zeros(0, dtype=np.int64), np.zeros((5, 0)), np.zeros((5, 0))).tolist() == [1.0] * 5
    )


def test_a_constant_sky_is_no_harm():
    import mitsuba as mi

    assert mi.variant()
    description = {name: thing for name, thing in test_portals.room().items() if name != "sky"}
    description["sky"] = {"type": "constant", "radiance": rgb(2.0)}
    scene = replace(load_dict(description), openings=test_portals.OPENINGS_OF_ROOM)
    assert float(scene.portals.fraction[0]) in SHARES[1:]
