"""The eight probes around a point, against all of them."""

from __future__ import annotations

import itertools

import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.light_field_probes.cells import CORNERS, Cells
from tests.baselines.probes.test_mappings import vectors

STEP = np.array([0.5, 0.6, 0.4])


def grid(*counts):
    return np.array(list(itertools.product(*map(range, counts)))) * STEP + [1.0, -2.0, 0.3]


def around(positions, points):
    """The probes around points, (N, 8)."""
    cells = Cells(positions)
    first = cells.first(vectors(points))
    return np.array([np.array(cells.probe(first, mi.UInt32(k))) for k in range(CORNERS)]).T


def test_in_a_whole_grid_they_are_the_corners_of_the_cell():
    positions = grid(4, 3, 3)
    low, high = positions.min(axis=0), positions.max(axis=0)
    points = np.random.default_rng(0).uniform(low, high, (300, 3))
    found = around(positions, points)
    offset = np.abs(positions[found] - points[:, None])
    assert (offset <= STEP + 1e-5).all()
    assert all(len(set(row)) == CORNERS for row in found)
    # Bit 0 counts along x, so that adding 3 goes on to a corner across a face or the cell.
    corners = positions[found][:, :, 0]
    assert (corners[:, 1::2] > corners[:, ::2]).all()


def test_outside_the_cell_at_the_edge_counts():
    positions = grid(3, 3, 3)
    far = np.array([[-1e6, -2, 0.3], [1e30, 1e30, 1e30], [1.2, -1.7, -1e9]])
    found = around(positions, far)
    nearest = np.clip(far, positions.min(axis=0), positions.max(axis=0))
    assert (np.abs(positions[found] - nearest[:, None]) <= STEP + 1e-5).all()


def test_gaps_are_filled_by_the_nearest_that_are_left():
    whole = grid(4, 4, 3)
    positions = np.delete(whole, [0, 7, 20, 21], axis=0)
    points = np.random.default_rng(1).uniform(whole.min(axis=0), whole.max(axis=0), (300, 3))
    found, complete = around(positions, points), around(whole, points)
    for row, corners in zip(found, complete, strict=True):
        assert len(set(row)) == CORNERS
        there = {tuple(place) for place in np.round(positions[row], 4)}
        dropped = {tuple(p) for p in np.round(whole[[0, 7, 20, 21]], 4)}
        assert {tuple(p) for p in np.round(whole[corners], 4)} - dropped <= there


@pytest.mark.parametrize("count", [1, 2, 5])
def test_few_probes_serve_several_corners(count):
    positions = grid(5, 1, 1)[:count]
    found = around(positions, np.zeros((1, 3)))[0]
    assert set(found) == set(range(count))


def test_a_flat_grid_takes_others_for_its_missing_floor():
    positions = grid(4, 4, 1)
    found = around(positions, positions.mean(axis=0, keepdims=True))[0]
    assert len(set(found)) == CORNERS
