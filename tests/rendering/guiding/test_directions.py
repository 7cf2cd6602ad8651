"""The square of directions: there and back, equal areas, and every direction there is."""

import numpy as np


def test_there_and_back():
    import drjit as dr
    import mitsuba as mi

    from gibench.rendering.guiding.directions import direction_of, square_of

    square = np.random.default_rng(0).random((2, 100_000)).astype(np.float32)
    direction = direction_of(mi.Point2f(square))
    np.testing.assert_allclose(np.array(dr.norm(direction)), 1, atol=1e-6)
    np.testing.assert_allclose(np.array(square_of(direction)), square, atol=2e-6)


def test_equal_areas():
    import mitsuba as mi

    from gibench.rendering.guiding.directions import BINS, bin_of

    rng = np.random.default_rng(1)
    count = 400 * BINS
    directions = rng.normal(size=(3, count))
    directions /= np.linalg.norm(directions, axis=0)
    found = np.bincount(np.array(bin_of(mi.Vector3f(directions.astype(np.float32)))), minlength=BINS)
    chi = ((found - count / BINS) ** 2 / (count / BINS)).sum()
    assert abs(chi - (BINS - 1)) < 5 * np.sqrt(2 * (BINS - 1))


def test_places_in_a_bin_lie_in_it():
    import drjit as dr
    import mitsuba as mi

    from gibench.rendering.guiding.directions import BINS, bin_of, direction_in

    number = dr.repeat(dr.arange(mi.UInt32, BINS), 64)
    place = mi.Point2f(np.random.default_rng(2).uniform(0.01, 0.99, (2, 64 * BINS)).astype(np.float32))
    assert (np.array(bin_of(direction_in(number, place))) == np.array(number)).all()


def test_axes_and_poles_have_bins():
    import mitsuba as mi

    from gibench.rendering.guiding.directions import BINS, bin_of, direction_of, square_of

    axes = np.concatenate([np.eye(3), -np.eye(3), -0.0 * np.eye(3) + np.eye(3)]).T.astype(np.float32)
    assert (np.array(bin_of(mi.Vector3f(axes))) < BINS).all()
    np.testing.assert_allclose(np.array(direction_of(square_of(mi.Vector3f(axes)))), axes, atol=1e-6)


def test_what_is_no_direction_has_a_bin_too():
    """Tables are gathered at its number."""
    import mitsuba as mi

    from gibench.rendering.guiding.directions import BINS, bin_of

    nan, inf = np.nan, np.inf
    strange = np.array(
        [[nan] * 3, [nan, 0, 1], [0, nan, -1], [inf, 0, 0], [0, 0, 0], [0, 0, 1.001], [2, -2, -2]]
    )
    assert (np.array(bin_of(mi.Vector3f(strange.T.astype(np.float32)))) < BINS).all()
