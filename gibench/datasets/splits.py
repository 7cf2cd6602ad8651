"""Splits of rooms into training, validation and testing."""

from __future__ import annotations

import math
from collections.abc import Mapping

#: Conjugate golden ratio: its multiples modulo 1 fill the unit interval more evenly than any other's.
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


def split_of(room: int, fractions: Mapping[str, float]) -> str:
    """Return the split that room number `room` belongs to.

    The room's place frac(φ·(room + ½)) in [0, 1) is looked up among the cumulative fractions. It depends on
    the room alone, so a dataset that grows never moves a room into another split, and every stretch of
    rooms, short ones too, holds close to the asked fractions. fractions: split name → share; the shares sum
    to 1.
    """
    place = math.fmod(GOLDEN * (room + 0.5), 1.0)
    upper = 0.0
    for name, share in fractions.items():
        upper += share
        if place < upper:
            return name
    # Shares that sum to 1 within rounding can leave a sliver below 1: it is the last split's with a share.
    return [name for name, share in fractions.items() if share > 0][-1]
