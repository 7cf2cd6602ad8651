"""Discrete distributions that are sampled with one look into memory."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

STEPS = 1 << 15
"""Shares are kept as multiples of 1/STEPS. Random numbers are as fine where the width is a power of two up to 256."""

MOST = 1 << 16
"""Items of a row: the number of one fits 16 bits."""


def alias_tables(weights: NDArray[Any]) -> tuple[NDArray[np.uint32], NDArray[np.float64]]:
    """Alias tables of rows of weights, and the probabilities that these tables have, to the last bit; (E, N) each.

    weights: (E, N), ≥ 0, each row with a positive sum, N at most MOST. An entry holds the alias in its upper 16 bits,
    and in the lower ones the share, of STEPS, with which the item itself stays. All rows are filled at once, by a sweep
    over their light and their heavy items (Hübschle-Schneider and Sanders 2022, section 3.2).
    """
    rows, width = weights.shape
    if width > MOST:
        raise ValueError(f"rows of {width} items: at most {MOST}")
    scaled = weights * (width / weights.sum(axis=1, keepdims=True))
    order = np.argsort(scaled > 1, axis=1, kind="stable")
    sweep = np.take_along_axis(scaled, order, axis=1)
    row, last = np.arange(rows), width - 1
    lights = (scaled <= 1).sum(axis=1)
    light, heavy = np.zeros(rows, dtype=np.int64), np.minimum(lights, last)
    rest = sweep[row, heavy]
    stays, alias = np.ones((rows, width)), np.tile(np.arange(width), (rows, 1))
    for _ in range(width):
        # A heavy item gives its surplus to light ones until it is light itself; then the next heavy one fills it up.
        to_light = (light < lights) & ((rest > 1) | (heavy >= last))
        filled = np.where(to_light, light, heavy)
        following = np.minimum(heavy + 1, last)
        giver = np.where(to_light, heavy, following)
        exists = np.where(to_light, lights < width, heavy < last)
        share = np.where(to_light, sweep[row, filled], rest)
        item = order[row, filled]
        stays[row, item] = np.where(exists, np.clip(share, 0, 1), 1)
        alias[row, item] = np.where(exists, order[row, giver], item)
        rest = np.where(to_light, rest - (1 - share), rest + sweep[row, following] - 1)
        light += to_light
        heavy = giver
    steps = np.rint(stays * STEPS).astype(np.int64)
    stays = steps / STEPS
    moved = np.bincount((row[:, None] * width + alias).ravel(), (1 - stays).ravel(), minlength=rows * width)
    packed = ((alias << 16) | steps).astype(np.uint32)
    return packed, np.asarray((stays + moved.reshape(rows, width)) / width)


def pick(table, row, width, u, active):
    """An item of a row of `alias_tables` (flat, mi.UInt32), whose rows have `width` items. u: mi.Float in [0, 1)."""
    scaled = u * mi.Float(width)
    item = dr.minimum(mi.UInt32(scaled), width - 1)
    packed = dr.gather(mi.UInt32, table, row * width + item, active)
    stays = (scaled - mi.Float(item)) * STEPS < mi.Float(packed & 0xFFFF)
    return dr.select(stays, item, packed >> 16)
