"""The eight probes around a point, of a grid that may have gaps."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

CORNERS = 8
"""Probes that are asked for a ray (McGuire et al. 2017)."""

SAME = 1e-3
"""Share of a grid's extent along an axis within which coordinates are the same."""


def _axis(values: NDArray[np.float64]) -> tuple[float, float, int]:
    """First coordinate, step and number of places of a regular axis that some of its places are known of."""
    low, extent = float(values.min()), float(np.ptp(values))
    apart = np.diff(np.sort(values))
    apart = apart[apart > SAME * extent]
    if not apart.size:
        return low, 1.0, 1
    step = float(apart.min())
    return low, step, round(extent / step) + 1


def cell_table(
    positions: NDArray[Any],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.uint32]]:
    """The cells between probes that stand on a regular grid.

    positions: (N, 3), N ≥ 1, m. Returns the corner of the first cell (3,), the steps (3,), and for each cell
    (X, Y, Z, 8) its probes, bit 0 of the last index counting along x. A corner without a probe, and one that is another
    again where the grid is flat, is stood in for by the probe nearest to the cell's centre that is not among them yet;
    where there are fewer than eight, by those that are.
    """
    positions = np.asarray(positions, dtype=np.float64)
    low, step, count = (np.array(part) for part in zip(*map(_axis, positions.T), strict=True))
    places = np.rint((positions - low) / step).astype(int)
    at = {tuple(place): number for number, place in enumerate(places)}
    cells = np.maximum(count - 1, 1)
    table = np.zeros((*cells, CORNERS), dtype=np.uint32)
    for cell in np.ndindex(*cells):
        x, y, z = cell
        corners = [(x + (k & 1), y + (k >> 1 & 1), z + (k >> 2 & 1)) for k in range(CORNERS)]
        found = [at.get(corner) for corner in corners]
        centre = low + (np.array(cell) + np.where(count > 1, 0.5, 0)) * step
        near = np.argsort(np.linalg.norm(positions - centre, axis=1), kind="stable")
        spare = [number for number in near if number not in found] or list(near)
        for k in range(CORNERS):
            if found[k] is None:
                found[k] = spare[0]
                spare = [*spare[1:], spare[0]] if len(positions) < CORNERS else spare[1:]
        table[cell] = found
    return low, step, table


class Cells:
    """The table on the device. arrays: what a `Replay` must hold."""

    def __init__(self, positions: NDArray[Any]) -> None:
        """positions: (N, 3) of the probes, m."""
        low, step, table = cell_table(positions)
        self._low, self._step = mi.Point3f(low.tolist()), mi.Vector3f(step.tolist())
        self._cells = mi.Vector3i(list(table.shape[:3]))
        self._table = mi.UInt32(table.ravel())
        self.arrays = {"low": self._low, "step": self._step, "cells": self._cells, "table": self._table}
        dr.make_opaque(self.arrays)

    def first(self, point: Any) -> Any:
        """Offset in the table of the cell around points (mi.Point3f), mi.UInt32; outside, the one at the edge."""
        place = mi.Vector3f(point - self._low) / self._step
        # Before whole numbers, which what is far outside does not fit into.
        at = mi.Vector3i(dr.clip(place, 0, mi.Vector3f(self._cells) - 0.5))
        return CORNERS * mi.UInt32((at.x * self._cells.y + at.y) * self._cells.z + at.z)

    def probe(self, first: Any, corner: Any) -> Any:
        """The probe (mi.UInt32) at a corner in [0, 8) of a cell."""
        return dr.gather(mi.UInt32, self._table, first + corner)
