import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gibench.benchmarks.report.labels import Box, Label, needs_line, place, spread

BOUNDS = Box(0, 0, 1000, 600)


@pytest.mark.parametrize("count", [1, 12, 40])
@pytest.mark.parametrize("room", [30, 900])
def test_no_label_lies_on_another_or_outside_and_none_that_is_required_is_lost(count, room):
    rng = np.random.default_rng(count)
    labels = [
        Label(500 + float(across), 300 + float(up), float(rng.uniform(30, 130)), 14)
        for across, up in rng.uniform(-room / 4, room / 4, (count, 2))
    ]
    boxes = place(labels, [], BOUNDS)
    assert all(box is not None and BOUNDS.holds(box) for box in boxes)
    for position, first in enumerate(boxes):
        assert not any(first.meets(other) for other in boxes[position + 1 :])


def test_a_label_keeps_its_size_and_stays_near_its_point():
    (box,) = place([Label(500, 300, 80, 12)], [], BOUNDS)
    assert (box.right - box.left, box.top - box.bottom) == pytest.approx((80, 12))
    assert math.hypot(*np.subtract(box.nearest(500, 300), (500, 300))) == pytest.approx(3, abs=1e-9)
    assert not needs_line(Label(500, 300, 80, 12), box)


def test_a_label_avoids_what_is_drawn():
    curve = [Box(x, 295, x + 10, 305) for x in range(0, 1000, 10)]
    (box,) = place([Label(500, 300, 80, 12)], curve, BOUNDS)
    assert not any(box.meets(other) for other in curve)


def test_a_label_that_may_be_dropped_is_dropped_where_it_is_crowded():
    wall = [Box(478, 278, 522, 322)]
    labels = [Label(500, 300, 40, 12, required=False), Label(500, 300, 40, 12)]
    dropped, kept = place(labels, wall, BOUNDS)
    assert dropped is None
    assert not kept.meets(wall[0])


def test_bounds_that_are_full_leave_a_label_without_a_place():
    boxes = place([Label(50, 10, 90, 14), Label(50, 10, 90, 14)], [], Box(0, 0, 100, 40))
    assert sum(box is None for box in boxes) == 1


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-50, 150), min_size=1, max_size=12))
def test_spread_keeps_order_distance_and_bounds(wanted):
    found = spread(wanted, 8, 0, 100)
    inside = np.array(found)[np.argsort(wanted, kind="stable")]
    step = min(8, 100 / max(1, len(wanted) - 1))
    assert (np.diff(inside) >= step - 1e-6).all()
    assert inside.min() >= -1e-6
    assert inside.max() <= 100 + 1e-6


def test_spread_moves_nothing_that_has_room_and_least_what_has_not():
    assert spread([10, 50, 90], 8, 0, 100) == [10, 50, 90]
    # Two at one place: half a step each, the least sum of squares.
    assert spread([50, 50], 8, 0, 100) == [46, 54]
    assert spread([], 8, 0, 100) == []
