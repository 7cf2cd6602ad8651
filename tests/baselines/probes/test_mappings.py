"""Directions on texels: round trips, poles and seams, and neighbours across the edges of a map."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.probes.mappings import LatLong, Octahedral

MAPS = [
    LatLong(32, 16),
    LatLong(2, 2),
    LatLong(256, 128),
    Octahedral(16, 16),
    Octahedral(2, 2),
    Octahedral(64, 64),
]


def name(mapping):
    return f"{mapping.name} {mapping.width}"


def columns(array):
    return np.array(array).T


def vectors(values):
    return mi.Vector3f(np.ascontiguousarray(np.asarray(values, dtype=np.float32).T))


def directions(count=4096, seed=0):
    v = np.random.default_rng(seed).normal(size=(count, 3))
    special = np.array(
        [[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)]
    )
    near = np.array(
        [[1e-4, 0, 1], [0, -1e-5, -1], [-1, 1e-7, 0], [-1, -1e-7, 0], [-1, 0.0, 0], [-1, -0.0, 0]]
    )
    all_of = np.concatenate([v, special, near])
    return all_of / np.linalg.norm(all_of, axis=1, keepdims=True)


@pytest.mark.parametrize("mapping", MAPS, ids=name)
def test_directions_come_back(mapping):
    d = directions()
    at = mapping.coordinates(vectors(d))
    x, y = columns(at).T
    assert ((x >= 0) & (x <= mapping.width) & (y >= 0) & (y <= mapping.height)).all()
    np.testing.assert_allclose(columns(mapping.direction(at)), d, atol=2e-6)


@pytest.mark.parametrize("mapping", MAPS, ids=name)
def test_texel_centres_come_back(mapping):
    row, column = np.indices((mapping.height, mapping.width)) + 0.5
    at = mi.Point2f(mi.Float(column.ravel()), mi.Float(row.ravel()))
    back = columns(mapping.coordinates(mapping.direction(at)))
    np.testing.assert_allclose(back, np.stack([column.ravel(), row.ravel()], axis=1), atol=1e-3)


@pytest.mark.parametrize("mapping", MAPS, ids=name)
def test_length_does_not_matter(mapping):
    d = directions()
    one, other = (columns(mapping.coordinates(vectors(d * scale))) for scale in (1.0, 37.0))
    apart = np.abs(one - other)
    apart = np.minimum(apart, mapping.width - apart)  # the seam may be either edge
    assert apart.max() < 1e-3


def test_lat_long_is_as_documented():
    """Middle +X, left of it +Y, right of it −Y, seam −X, top +Z, bottom −Z."""
    mapping = LatLong(8, 4)
    expected = {
        (1, 0, 0): (4, 2),
        (0, 1, 0): (2, 2),
        (0, -1, 0): (6, 2),
        (1, 0, 1): (4, 1),
        (1, 0, -1): (4, 3),
        (1, 1, 0): (3, 2),
    }
    for direction, place in expected.items():
        np.testing.assert_allclose(columns(mapping.coordinates(vectors([direction])))[0], place, atol=1e-5)
    assert columns(mapping.coordinates(vectors([(0, 0, 1)])))[0, 1] == pytest.approx(0, abs=1e-5)
    assert columns(mapping.coordinates(vectors([(0, 0, -1)])))[0, 1] == pytest.approx(4, abs=1e-5)
    assert columns(mapping.coordinates(vectors([(-1, 0, 0)])))[0, 0] % 8 == pytest.approx(0, abs=1e-5)


def test_octahedral_is_as_documented():
    mapping = Octahedral(8, 8)
    for direction, place in {
        (0, 0, 1): (4, 4),
        (1, 0, 0): (8, 4),
        (0, 1, 0): (4, 8),
        (-1, 0, 0): (0, 4),
    }.items():
        np.testing.assert_allclose(columns(mapping.coordinates(vectors([direction])))[0], place, atol=1e-5)
    corner = columns(mapping.coordinates(vectors([(0, 0, -1)])))[0]
    assert set(np.round(corner)) <= {0.0, 8.0}


@pytest.mark.parametrize("mapping", [LatLong(64, 32), Octahedral(32, 32)], ids=name)
def test_neighbours_across_an_edge_touch(mapping):
    """The middles of two neighbouring texels are about one texel apart on the sphere, inside of the map or not."""
    row, column = np.indices((mapping.height, mapping.width)).reshape(2, -1)
    centre = columns(mapping.direction(mi.Point2f(mi.Float(column + 0.5), mi.Float(row + 0.5))))
    largest = 0.0
    for step_x, step_y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        x, y = mapping.wrapped(mi.Int32(column + step_x), mi.Int32(row + step_y))
        x, y = np.array(x), np.array(y)
        assert ((x >= 0) & (x < mapping.width) & (y >= 0) & (y < mapping.height)).all()
        angle = np.arccos(np.clip(np.sum(centre * centre[y * mapping.width + x], axis=1), -1, 1))
        largest = max(largest, float(angle.max()))
    assert largest < 2.5 * np.pi / mapping.height


@pytest.mark.parametrize("mapping", [LatLong(64, 32), Octahedral(32, 32)], ids=name)
def test_no_texel_is_its_own_neighbour(mapping):
    row, column = np.indices((mapping.height, mapping.width)).reshape(2, -1)
    for step_x, step_y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        x, y = mapping.wrapped(mi.Int32(column + step_x), mi.Int32(row + step_y))
        itself = (np.array(x) == column) & (np.array(y) == row)
        assert not itself.any()


def test_wrapping_leaves_the_inside_alone():
    for mapping in MAPS:
        row, column = np.indices((mapping.height, mapping.width)).reshape(2, -1)
        x, y = mapping.wrapped(mi.Int32(column), mi.Int32(row))
        np.testing.assert_array_equal(np.array(x), column)
        np.testing.assert_array_equal(np.array(y), row)
    assert dr.width(x) == MAPS[-1].width * MAPS[-1].height


@pytest.mark.parametrize("mapping", MAPS, ids=name)
def test_no_direction_and_tiny_ones_have_a_texel(mapping):
    tiny = np.array([[0, 0, 0], [0, 0, 1e-38], [1e-30, 0, 0], [-1e-25, 1e-25, -1e-25], [0, 1e30, 1e30]])
    at = columns(mapping.coordinates(vectors(tiny)))
    assert np.isfinite(at).all()
    assert ((at >= 0) & (at <= [mapping.width, mapping.height])).all()
    unit = np.array([[0, 0, 1], [0, 0, 1], [1, 0, 0], [-1, 1, -1], [0, 1, 1]])
    np.testing.assert_allclose(at, columns(mapping.coordinates(vectors(unit))), atol=1e-4 * mapping.width)


@pytest.mark.parametrize("mapping", [LatLong(16, 8), Octahedral(16, 16)], ids=lambda mapping: mapping.name)
def test_what_surrounds_a_map_touches_it_on_the_sphere(mapping):
    """Directions of the texels as an image: beyond the edge they go on in steps as small as within."""
    row, column = np.indices((mapping.height, mapping.width))
    middles = mi.Point2f(mi.Float(column.ravel() + 0.5), mi.Float(row.ravel() + 0.5))
    image = columns(mapping.direction(middles)).reshape(mapping.height, mapping.width, 3)
    wide = mapping.surrounded(image, 3)
    above = (wide.shape[0] - mapping.height) // 2
    assert wide.shape[1] == mapping.width + 6
    np.testing.assert_array_equal(wide[above : above + mapping.height, 3:-3], image)
    across = np.linalg.norm(np.diff(wide, axis=1), axis=2)
    assert across.max() <= 1.001 * np.linalg.norm(np.diff(image, axis=1), axis=2).max()
    down = np.linalg.norm(np.diff(wide, axis=0), axis=2)
    assert down.max() <= 1.001 * np.linalg.norm(np.diff(image, axis=0), axis=2).max()


def test_an_octahedral_map_is_surrounded_by_the_texels_that_a_lookup_wraps_to():
    mapping = Octahedral(8, 8)
    numbers = np.arange(64).reshape(8, 8, 1)
    wide = mapping.surrounded(numbers, 1)[..., 0]
    for row, column in [(-1, 3), (8, 0), (5, -1), (2, 8)]:
        x, y = mapping.wrapped(mi.Int32(column), mi.Int32(row))
        assert wide[row + 1, column + 1] == 8 * y[0] + x[0]
