"""Bootstrap intervals: known cases, coverage, and what clustering must change."""

import numpy as np
import pytest

from gibench.metrics import MetricInputError, NonFiniteError, ShapeError, mean_interval, paired_difference


def rooms_and_values(rng, rooms=30, frames=8, between=1.0, within=0.3):
    room = np.repeat(np.arange(rooms), frames)
    return room, 5 + between * rng.standard_normal(rooms)[room] + within * rng.standard_normal(room.size)


def test_width_is_that_of_the_closed_form(rng):
    # Drawing rooms, then frames: the variance of the resampled mean is known exactly for equal rooms.
    room, values = rooms_and_values(rng, rooms=40, frames=10)
    table = values.reshape(40, 10)
    variance = table.mean(axis=1).var() / 40 + table.var(axis=1).mean() / 10 / 40
    interval = mean_interval(values, room, resamples=20_000)
    assert interval.mean == pytest.approx(values.mean())
    assert interval.high - interval.low == pytest.approx(2 * 1.96 * np.sqrt(variance), rel=0.05)
    assert (interval.rooms, interval.frames) == (40, 400)


def test_covers_the_truth_as_often_as_it_says():
    hits = 0
    for trial in range(200):
        room, values = rooms_and_values(np.random.default_rng(trial), rooms=25, frames=5)
        interval = mean_interval(values, room, level=0.9, resamples=400, seed=trial)
        hits += interval.low <= 5 <= interval.high
    # 200 trials at 90 %: three standard deviations are 6.4 %.
    assert 0.9 - 0.064 <= hits / 200 <= 0.9 + 0.064


def test_frames_of_one_room_are_not_so_many_rooms(rng):
    room, values = rooms_and_values(rng, rooms=10, frames=50, between=1.0, within=0.1)
    clustered = mean_interval(values, room)
    naive = mean_interval(values, np.arange(values.size))
    assert clustered.high - clustered.low > 4 * (naive.high - naive.low)


def test_rooms_weigh_the_same_however_many_frames_they_have():
    interval = mean_interval([1.0, 1.0, 1.0, 1.0, 4.0], ["a", "a", "a", "a", "b"])
    assert interval.mean == 2.5
    assert (interval.low, interval.high) == (1.0, 4.0)


def test_one_room_still_varies_by_its_frames(rng):
    values = rng.normal(3, 1, 400)
    interval = mean_interval(values, np.zeros(400, int))
    assert interval.rooms == 1
    assert interval.high - interval.low == pytest.approx(2 * 1.96 * values.std() / 20, rel=0.1)


def test_constant_values_have_no_width():
    interval = mean_interval(np.full(6, 2.0), [0, 0, 1, 1, 2, 2])
    assert (interval.low, interval.mean, interval.high) == (2.0, 2.0, 2.0)


def test_the_seed_decides_and_nothing_else(rng):
    room, values = rooms_and_values(rng)
    np.random.seed(1)  # noqa: NPY002 - to see that the global state is not used
    first = mean_interval(values, room)
    np.random.seed(2)  # noqa: NPY002
    assert mean_interval(values, room) == first
    assert mean_interval(values, room, seed=1) != first


def test_order_of_frames_and_names_of_rooms_do_not_matter_for_the_mean(rng):
    room, values = rooms_and_values(rng)
    order = rng.permutation(values.size)
    shuffled = mean_interval(values[order], np.array([f"room-{r}" for r in room])[order])
    plain = mean_interval(values, room)
    assert shuffled.mean == pytest.approx(plain.mean)
    assert (shuffled.low, shuffled.high) == pytest.approx((plain.low, plain.high), abs=0.05)


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
    with pytest.raises(ShapeError, match="one length"):
        mean_interval([1.0, 2.0], [0])
    with pytest.raises(ShapeError, match="one length"):
        mean_interval([], [])
    with pytest.raises(NonFiniteError, match="1 non-finite values, the first at frame 1"):
        mean_interval([1.0, np.nan], [0, 0])
    with pytest.raises(NonFiniteError):
        paired_difference([np.inf, 1.0], [np.inf, 1.0], [0, 0])
    with pytest.raises(ShapeError, match="same frames"):
        paired_difference([1.0, 2.0], [1.0], [0, 0])
    for keywords in ({"level": 1.0}, {"level": 0.0}, {"resamples": 0}):
        with pytest.raises(MetricInputError, match="level"):
            mean_interval([1.0], [0], **keywords)
