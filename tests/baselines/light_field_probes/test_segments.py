"""Segments of rays on octahedral maps, against the mapping of one direction after another."""

from __future__ import annotations

import itertools

import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.light_field_probes.segments import octant_planes, segment_end, segment_of
from gibench.baselines.probes.mappings import Octahedral
from tests.baselines.meshes import directions
from tests.baselines.probes.test_mappings import columns, vectors

SIDE = 64
FAR = 50.0


def rays(count=400, seed=0):
    """Origins and directions, some of them along axes and in the planes between octants."""
    origin, towards = np.random.default_rng(seed).uniform(-1, 1, (count, 3)), directions(count, seed + 1)
    origin[:40, 0] = 0
    towards[20:60, 1] = 0
    towards[60:90] = np.eye(3)[np.arange(30) % 3]
    return origin, towards / np.linalg.norm(towards, axis=1, keepdims=True)


def segments(origin, direction):
    """Begin and end of the segments of each ray, (segment, ray), until FAR."""
    planes = octant_planes(vectors(origin), vectors(direction))
    begin = [mi.Float(np.zeros(len(origin), dtype=np.float32))]
    while (np.array(begin[-1]) < FAR).any():
        begin.append(segment_end(planes, begin[-1], mi.Float(FAR)))
    return np.array([np.array(way) for way in begin])


def test_a_ray_has_at_most_four_and_they_cover_it():
    ends = segments(*rays())
    assert len(ends) <= 5
    assert (np.diff(ends, axis=0) >= 0).all()
    np.testing.assert_array_equal(ends[-1], FAR)


def test_places_are_those_of_the_directions():
    """Within a segment: beside its ends, where the map has its seams."""
    origin, direction = rays()
    mapping = Octahedral(SIDE, SIDE)
    ends = segments(origin, direction)
    compared = 0
    for begin, end in itertools.pairwise(ends):
        segment = segment_of(
            vectors(origin), vectors(direction), mi.Float(0.5 * (begin + end)), mi.Float(SIDE)
        )
        for share in (0.01, 0.1, 0.5, 0.9, 0.99):
            way = (begin + share * (end - begin)).astype(np.float32)
            point = origin + way[:, None] * direction
            inside = (end - begin > 1e-2) & (np.linalg.norm(point, axis=1) > 1e-2)
            expected = columns(mapping.coordinates(vectors(point)))[inside]
            found = np.array([segment.column_at(mi.Float(way)), segment.row_at(mi.Float(way))]).T[inside]
            # A point in a plane between octants lies on either side of a seam.
            seam = (np.abs(point[inside]) < 1e-3).any(axis=1) & (point[inside, 2] <= 1e-3)
            np.testing.assert_allclose(found[~seam], expected[~seam], atol=2e-3)
            compared += (~seam).sum()
    assert compared > 2000


def test_crossings_are_where_the_place_is_the_edge():
    origin, direction = rays()
    ends = segments(origin, direction)
    for begin, end in itertools.pairwise(ends):
        segment = segment_of(
            vectors(origin), vectors(direction), mi.Float(0.5 * (begin + end)), mi.Float(SIDE)
        )
        first, last = (begin + share * (end - begin) for share in (0.05, 0.95))
        for place, at in ((segment.column, segment.column_at), (segment.row, segment.row_at)):
            low, high = (np.array(at(mi.Float(way.astype(np.float32)))) for way in (first, last))
            edge = np.where(high > low, np.floor(low) + 1, np.ceil(low) - 1)
            between = (edge - low) * (edge - high) < 0
            forward = np.array(segment.forward(place))
            moved = np.abs(high - low) > 1e-2
            np.testing.assert_array_equal(forward[moved], (high > low)[moved])
            way = np.array(segment.crossing(place, mi.Float(edge.astype(np.float32))))
            slow = np.abs(high - low) < 1e-2 * (last - first)  # hardly moves: the way is ill-conditioned
            known = between & moved & ~slow
            assert (way[known] > first[known] - 1e-3).all()
            assert (way[known] < last[known] + 1e-3).all()
            found = np.array(at(mi.Float(way)))
            np.testing.assert_allclose(found[known], edge[known], atol=2e-3)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_through_the_probe_itself_the_place_jumps_to_the_other_side(axis):
    """All planes are crossed at once: one segment towards the probe, one away from it."""
    direction = np.array([[0.4, -0.5, 0.7]]) / np.linalg.norm([0.4, -0.5, 0.7])
    direction = np.roll(direction, axis, axis=1)
    origin = -direction
    ends = segments(origin, direction)
    long = np.diff(ends, axis=0)[:, 0] > 1e-5
    assert long.sum() == 2
    mapping = Octahedral(SIDE, SIDE)
    for begin, end, seen in zip(ends[:-1][long], ends[1:][long], (-direction, direction), strict=True):
        segment = segment_of(
            vectors(origin), vectors(direction), mi.Float(0.5 * (begin + end)), mi.Float(SIDE)
        )
        middle = mi.Float((0.5 * (begin + end)).astype(np.float32))
        found = [segment.column_at(middle)[0], segment.row_at(middle)[0]]
        np.testing.assert_allclose(found, columns(mapping.coordinates(vectors(seen)))[0], atol=1e-2)
