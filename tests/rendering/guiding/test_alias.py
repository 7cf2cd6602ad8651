"""Alias tables have the distribution that they say, which is the one asked for."""

import numpy as np
import pytest

ROWS = {
    "uneven": lambda rng: rng.random((50, 256)) ** 6 + 1e-9,
    "not a power of two": lambda rng: rng.random((40, 13)),
    "even": lambda rng: np.ones((3, 7)),
    "one item each": lambda rng: np.eye(9),
    "a single item": lambda rng: np.ones((4, 1)),
    "a thousand items": lambda rng: rng.random((5, 1000)) ** 9,
    "huge and tiny": lambda rng: 10.0 ** rng.uniform(-200, 200, (20, 16)),
}


@pytest.mark.parametrize("name", ROWS)
def test_probabilities_are_those_of_the_weights(name):
    from gibench.rendering.guiding.alias import STEPS, alias_tables

    weights = ROWS[name](np.random.default_rng(0))
    packed, probability = alias_tables(weights)
    np.testing.assert_allclose(probability, weights / weights.sum(axis=1, keepdims=True), atol=1 / STEPS)
    # What the table itself says, item by item.
    stays, alias = (packed & 0xFFFF) / STEPS, packed >> 16
    said = stays.copy()
    for row, item in np.ndindex(*packed.shape):
        said[row, alias[row, item]] += 1 - stays[row, item]
    np.testing.assert_allclose(said / packed.shape[1], probability, atol=1e-12)
    np.testing.assert_allclose(probability.sum(axis=1), 1, atol=1e-12)


def test_picked_items_follow_the_table():
    import drjit as dr
    import mitsuba as mi

    from gibench.rendering.guiding.alias import alias_tables, pick

    rng = np.random.default_rng(1)
    packed, probability = alias_tables(rng.random((2, 12)) ** 3)
    count = 1 << 20
    u = mi.Float((np.arange(count) + 0.5).astype(np.float32) / count)
    items = np.array(
        pick(mi.UInt32(packed.ravel()), dr.full(mi.UInt32, 1, count), mi.UInt32(12), u, mi.Bool(True))
    )
    np.testing.assert_allclose(np.bincount(items, minlength=12) / count, probability[1], atol=1e-4)


def test_too_many_items_are_refused():
    from gibench.rendering.guiding.alias import MOST, alias_tables

    with pytest.raises(ValueError, match="at most"):
        alias_tables(np.ones((1, MOST + 1)))
