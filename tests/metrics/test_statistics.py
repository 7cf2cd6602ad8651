"""Intervals: known cases, coverage, and what rooms and seeds must change."""

import numpy as np
import pytest
import scipy.stats

from gibench.metrics import MetricInputError, NonFiniteError, ShapeError, mean_interval, paired_difference


def rooms_and_values(rng, rooms=30, frames=8, between=1.0, within=0.3):
    room = np.repeat(np.arange(rooms), frames)
    return room, 5 + between * rng.standard_normal(rooms)[room] + within * rng.standard_normal(room.size)


def test_width_is_that_of_the_closed_form(rng):
    room, values = rooms_and_values(rng, rooms=9, frames=10)
    means = values.reshape(9, 10).mean(axis=1)
    interval = mean_interval(values, room)
    assert interval.mean == pytest.approx(values.mean())
    expected = scipy.stats.t.interval(0.95, 8, means.mean(), scipy.stats.sem(means))
    assert (interval.low, interval.high) == pytest.approx(expected)
    assert (interval.rooms, interval.frames) == (9, 90)


@pytest.mark.parametrize("rooms", [3, 25])
def test_covers_the_truth_as_often_as_it_says(rooms):
    hits = 0
    for trial in range(400):
        room, values = rooms_and_values(np.random.default_rng(trial), rooms=rooms, frames=5)
        interval = mean_interval(values, room, level=0.9)
        hits += interval.low <= 5 <= interval.high
    # 400 trials at 90 %: three standard deviations are 4.5 %.
    assert 0.9 - 0.045 <= hits / 400 <= 0.9 + 0.045


@pytest.mark.parametrize(
    ("seeds", "spread", "own"), [(3, 0.06, 0.0), (3, 0.0, 0.06), (3, 0.06, 0.06), (5, 0.06, 0.0)]
)
def test_seeds_that_differ_do_not_make_methods_differ(rng, seeds, spread, own):
    """Two methods that are equal, 20 rooms that spread by .1: one seed is bad in all rooms, or each where it likes."""
    wrong, trials, rooms = 0, 600, 20
    room = np.repeat(np.arange(rooms), 4)
    for _ in range(trials):
        hard = rng.normal(0, 0.1, rooms)[room]
        methods = [
            side * hard / 2 + rng.normal(0, spread, (seeds, 1)) + rng.normal(0, own, (seeds, rooms))[:, room]
            for side in (1, -1)
        ]
        wrong += paired_difference(*methods, room).excludes_zero
    # 5 % is meant, of 600 trials: three standard deviations are 2.7 %. Seeds that are averaged away make it 43 %.
    assert 0.015 <= wrong / trials <= 0.077


def test_a_seed_more_is_no_room_more(rng):
    room, values = rooms_and_values(rng, rooms=6, frames=3)
    alone = mean_interval(values, room)
    assert mean_interval(np.stack([values] * 4), room) == alone
    apart = mean_interval(np.stack([values - 1, values + 1]), room)
    assert apart.mean == pytest.approx(alone.mean)
    assert apart.high - apart.low > 3 * (alone.high - alone.low)


def test_seeds_of_two_methods_are_not_the_same_seeds(rng):
    room, values = rooms_and_values(rng, rooms=6, frames=3)
    first, second = np.stack([values, values + 1]), np.stack([values + 1, values])
    # Seed by seed the one would always be better by 1, then always worse: a difference of seeds, not of methods.
    assert not paired_difference(first, second, room).excludes_zero
    assert paired_difference(first, first, room).high > 1


def test_frames_of_one_room_are_not_so_many_rooms(rng):
    room, values = rooms_and_values(rng, rooms=10, frames=50, between=1.0, within=0.1)
    clustered = mean_interval(values, room)
    naive = mean_interval(values, np.arange(values.size))
    assert clustered.high - clustered.low > 4 * (naive.high - naive.low)


def test_rooms_weigh_the_same_however_many_frames_they_have():
    interval = mean_interval([1.0, 1.0, 1.0, 1.0, 4.0], ["a", "a", "a", "a", "b"])
    two = mean_interval([1.0, 4.0], ["a", "b"])
    assert (interval.mean, interval.low, interval.high) == (2.5, two.low, two.high)


def test_one_room_still_varies_by_its_frames(rng):
    values = rng.normal(3, 1, 400)
    interval = mean_interval(values, np.zeros(400, int))
    assert interval.rooms == 1
    assert interval.high - interval.low == pytest.approx(2 * 1.96 * values.std() / 20, rel=0.1)


def test_constant_values_have_no_width():
    interval = mean_interval(np.full(6, 2.0), [0, 0, 1, 1, 2, 2])
    assert (interval.low, interval.mean, interval.high) == (2.0, 2.0, 2.0)


def test_one_value_says_nothing_of_how_values_differ():
    interval = mean_interval([2.0], ["a"])
    assert (interval.low, interval.mean, interval.high) == (-np.inf, 2.0, np.inf)
    assert not interval.excludes_zero


def test_order_of_frames_and_names_of_rooms_do_not_matter_for_the_mean(rng):
    room, values = rooms_and_values(rng)
    order = rng.permutation(values.size)
    shuffled = mean_interval(values[order], np.array([f"room-{r}" for r in room])[order])
    plain = mean_interval(values, room)
    assert shuffled.mean == pytest.approx(plain.mean)
    assert (shuffled.low, shuffled.high) == pytest.approx((plain.low, plain.high))


def test_higher_level_is_wider(rng):
    room, values = rooms_and_values(rng)
    narrow, wide = (mean_interval(values, room, level=level) for level in (0.8, 0.99))
    assert wide.low < narrow.low < narrow.high < wide.high


def test_paired_difference_sees_what_two_intervals_hide(rng):
    room, hard = rooms_and_values(rng, between=2.0, within=1.0)
    first, second = hard + 0.05 + 0.01 * rng.standard_normal(hard.size), hard
    apart = [mean_interval(values, room) for values in (first, second)]
    assert apart[0].low < apart[1].high
    difference = paired_difference(first, second, room)
    assert difference.mean == pytest.approx(0.05, abs=0.01)
    assert difference.excludes_zero
    swapped = paired_difference(second, first, room)
    assert (swapped.low, swapped.high) == pytest.approx((-difference.high, -difference.low), abs=1e-3)


def test_no_difference_is_not_called_one(rng):
    room, values = rooms_and_values(rng)
    assert not paired_difference(values, values, room).excludes_zero
    noisy = values + rng.standard_normal(values.size)
    assert not paired_difference(noisy - noisy.mean() + values.mean(), values, room).excludes_zero


def test_bad_input():
    with pytest.raises(ShapeError, match="must be"):
        mean_interval([1.0, 2.0], [0])
    with pytest.raises(ShapeError, match="must be"):
        mean_interval([], [])
    with pytest.raises(NonFiniteError, match="1 non-finite values, the first at frame 1"):
        mean_interval([1.0, np.nan], [0, 0])
    with pytest.raises(NonFiniteError):
        paired_difference([np.inf, 1.0], [np.inf, 1.0], [0, 0])
    with pytest.raises(ShapeError, match="second"):
        paired_difference([1.0, 2.0], [1.0], [0, 0])
    for keywords in ({"level": 1.0}, {"level": 0.0}):
        with pytest.raises(MetricInputError, match="level"):
            mean_interval([1.0], [0], **keywords)


def test_few_rooms_and_seeds_give_no_absurd_interval():
    """What rooms and seeds have together is taken out of the spread of the seeds: next to nothing may be left."""
    rng = np.random.default_rng(17)
    for _ in range(200):
        values = 0.04 * rng.uniform(0.97, 1.03, (3, 28))
        interval = mean_interval(values, np.repeat(["a", "b"], 14))
        assert interval.high - interval.low < 0.04
