import numpy as np
import pytest

from gibench.datasets.splits import split_of

FRACTIONS = {"train": 0.8, "validation": 0.1, "test": 0.1}


@pytest.mark.parametrize("rooms", [20, 50, 200, 1000])
def test_every_stretch_of_rooms_holds_close_to_the_shares(rooms):
    # The discrepancy of the golden sequence is below (log₂ N + 2)/N, which pure chance exceeds at once.
    splits = [split_of(room, FRACTIONS) for room in range(rooms)]
    for name, share in FRACTIONS.items():
        assert abs(splits.count(name) - share * rooms) <= np.log2(rooms) + 2


def test_consecutive_rooms_of_a_small_share_lie_apart():
    rooms = [room for room in range(400) if split_of(room, FRACTIONS) == "test"]
    assert np.diff(rooms).min() >= 5


def test_a_share_of_zero_is_never_taken_and_of_one_always():
    assert {split_of(room, {"train": 1.0, "test": 0.0}) for room in range(1000)} == {"train"}
    assert {split_of(room, {"train": 0.0, "test": 1.0}) for room in range(1000)} == {"test"}


def test_rounding_of_the_shares_leaves_no_room_out():
    shares = {f"s{i}": 0.1 for i in range(10)}  # sums to 0.9999999999999999
    assert {split_of(room, shares) for room in range(2000)} == set(shares)
