"""Propagation of light through a volume, against closed forms."""

from __future__ import annotations

import math

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.light_propagation_volumes.geometry import passing
from gibench.baselines.light_propagation_volumes.implementation import spread
from gibench.baselines.light_propagation_volumes.volume import (
    AHEAD,
    ASIDE,
    AXES,
    COMPONENTS,
    EVEN,
    Grid,
    as_intensity,
    emptied,
    injected,
    looked_up,
    propagated,
    rays_of_a_step,
)

GRID = Grid((-1.0, -2.0, 0.0), 0.25, (9, 9, 9))
RED = (0, 4)
"""Components of a colour."""


def injection(grid, points, normals, flux):
    sums = emptied(grid.size)
    arrays = [np.ascontiguousarray(np.asarray(part, dtype=np.float32).T) for part in (points, normals, flux)]
    injected(
        grid.arrays, sums, mi.Point3f(arrays[0]), mi.Vector3f(arrays[1]), mi.Color3f(arrays[2]), mi.Bool(True)
    )
    state = as_intensity(sums)
    dr.eval(state)
    return state


def values(grid, state):
    """(COMPONENTS, X, Y, Z)."""
    return (
        np.array([np.array(part) for part in state])
        .reshape(COMPONENTS, *grid.counts[::-1])
        .transpose(0, 3, 2, 1)
    )


def middle(grid, cell):
    return np.array(grid.low) + grid.side * (np.array(cell) + 0.5)


def total_flux(grid, state):
    """By colour."""
    return 4 * np.pi * values(grid, state)[::4].sum(axis=(1, 2, 3))


def test_faces_fill_the_sphere():
    ticks = (np.arange(400) + 0.5) / 400 - 0.5
    u, v = np.meshgrid(ticks, ticks)
    assert pytest.approx(np.mean(1.5 / (1.5**2 + u**2 + v**2) ** 1.5), rel=1e-5) == AHEAD
    assert pytest.approx(np.mean(0.5 / (0.5**2 + u**2 + (v + 1) ** 2) ** 1.5), rel=1e-5) == ASIDE
    rays = rays_of_a_step()
    assert len(rays) == 30
    assert pytest.approx(4 * math.pi) == 6 * (AHEAD + 4 * ASIDE)
    assert np.linalg.norm([ray for _, ray in rays], axis=1) == pytest.approx(1)
    assert np.sum([ray for _, ray in rays], axis=0) == pytest.approx(0, abs=1e-12)


def test_injection_keeps_energy_in_any_order():
    rng = np.random.default_rng(0)
    points = rng.uniform((-0.7, -1.7, 0.3), (0.9, -0.1, 1.9), (500, 3))
    normals = rng.normal(size=(500, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    flux = rng.uniform(0, 1 / 500, (500, 3))
    state = injection(GRID, points, normals, flux)
    assert total_flux(GRID, state) == pytest.approx(flux.sum(axis=0), rel=1e-5)
    order = rng.permutation(500)
    again = injection(GRID, points[order], normals[order], flux[order])
    np.testing.assert_array_equal(values(GRID, state), values(GRID, again))


def test_a_virtual_light_is_a_cosine_half_a_cell_before_its_surface():
    state = values(
        GRID, injection(GRID, [middle(GRID, (4, 4, 4)) - [0, 0, 0.45 * 0.25]], [[0, 0, 1]], [[0.5, 0, 1]])
    )
    cell = state[:, 4, 4, 4]
    assert cell == pytest.approx(
        np.array(
            [0.5 / (4 * np.pi), 0, 0, 0.5 / (2 * np.pi)] + [0] * 4 + [1 / (4 * np.pi), 0, 0, 1 / (2 * np.pi)]
        ),
        rel=1e-5,
    )
    state[:, 4, 4, 4] = 0
    assert not state.any()


def test_what_is_outside_or_far_away_is_left_out():
    far = [[9.0, 0, 0], [-1e30, 0, 0], [0, 1e20, 0]]
    assert not values(GRID, injection(GRID, far, [[1, 0, 0]] * 3, [[0.3] * 3] * 3)).any()


def test_even_light_is_kept_until_it_leaves():
    state = [dr.zeros(mi.Float, GRID.size) for _ in range(COMPONENTS)]
    dr.scatter(state[0], mi.Float(1 / (4 * dr.pi)), mi.UInt32(4 + 9 * (4 + 9 * 4)))
    after = propagated(GRID.arrays, state, None, GRID.size)
    assert total_flux(GRID, after) == pytest.approx([1, 0, 0], abs=1e-6)
    inside = values(GRID, after)
    assert inside[0, 4, 4, 5] == pytest.approx(1 / 6 / (4 * np.pi), rel=1e-5)
    for travel in AXES:
        cell = tuple((4 + np.array(travel)).astype(int))
        assert inside[(1, *cell)] == pytest.approx(travel[0] * inside[1, 5, 4, 4], abs=1e-9)


@pytest.mark.parametrize("steps", [1, 4])
def test_all_six_directions_are_alike(steps):
    """Light sent along an axis spreads as light sent along +z does, turned."""

    def sent(direction):
        state = injection(
            GRID, [middle(GRID, (4, 4, 4)) - 0.4 * 0.25 * np.array(direction)], [direction], [[1, 0, 0]]
        )
        return values(GRID, spread(GRID.arrays, state, None, steps, GRID.size))[slice(*RED)]

    expected = sent((0, 0, 1))
    for axis, direction in zip(np.repeat(range(3), 2), AXES, strict=True):
        found = sent(direction)
        if sum(direction) < 0:
            found = np.flip(found, axis=1 + axis).copy()
            found[1 + axis] *= -1
        turned = np.moveaxis(found[0], axis, 2)
        np.testing.assert_allclose(turned, expected[0], atol=1e-7)
        np.testing.assert_allclose(np.moveaxis(found[1 + axis], axis, 2), expected[3], atol=1e-7)
    beside = expected[0] - expected[0][::-1]
    np.testing.assert_allclose(beside, 0, atol=1e-7)
    np.testing.assert_allclose(expected[0], expected[0].transpose(1, 0, 2), atol=1e-7)


def box_sides(low, high, side, inwards):
    """Middles of the squares on the sides of a box, (N, 3), and their normals. low, high: in sides of a square."""
    points, normals = [], []
    for axis in range(3):
        others = [a for a in range(3) if a != axis]
        first, second = np.meshgrid(*(np.arange(low[a], high[a]) + 0.5 for a in others), indexing="ij")
        for wall, facing in ((low[axis], 1.0), (high[axis], -1.0)):
            place, normal = np.zeros((first.size, 3)), np.zeros((first.size, 3))
            place[:, others[0]], place[:, others[1]], place[:, axis] = first.ravel(), second.ravel(), wall
            normal[:, axis] = facing if inwards else -facing
            points.append(place)
            normals.append(normal)
    return side * np.concatenate(points), np.concatenate(normals)


def received(grid, points, normals, steps, shares=None):
    """Irradiance on squares as large as a cell's faces that all send out one W/m², (N,)."""
    state = injection(grid, points, normals, np.full((len(points), 3), 1 / len(points)))
    total = spread(grid.arrays, state, shares, steps, grid.size)
    at = mi.Point3f(np.ascontiguousarray((points + 0.5 * grid.side * normals).T, dtype=np.float32))
    towards = mi.Vector3f(np.ascontiguousarray(-normals.T, dtype=np.float32))
    found = looked_up(grid.arrays, total, at, towards, mi.Bool(True))
    return np.array(found.x) * len(points) * EVEN


def shares_of(grid, points, normals):
    """What squares as large as a cell's faces let through, for `spread`."""
    areas = np.full(len(points), grid.side**2)
    return [mi.Float(np.ascontiguousarray(share)) for share in passing(grid, points, normals, areas)]


@pytest.mark.parametrize("counts", [(8, 8, 8), (12, 6, 8)])
def test_the_walls_of_a_closed_white_box_receive_what_they_send_out(counts):
    """Whatever its shape, for the form factors of a closed box add up to 1; the only factor is EVEN."""
    grid = Grid((0.0, 0.0, 0.0), 0.25, counts)
    walls = box_sides((0, 0, 0), counts, 0.25, inwards=True)
    found = received(grid, *walls, 96)
    assert found.mean() == pytest.approx(1, abs=0.03)
    assert np.abs(found - 1).max() < 0.2  # corners and edges are the worst
    # Nothing is in the way of what passes along the walls and of what is on its way to them.
    np.testing.assert_array_equal(received(grid, *walls, 96, shares_of(grid, *walls)), found)


def test_walls_within_a_larger_grid_keep_light_in():
    """As if the grid ended with them, but for the first step, which nothing blocks."""
    counts = np.array((8, 8, 8))
    walls = box_sides((1, 1, 1), counts + 1, 0.25, inwards=True)
    grid = Grid((0.0, 0.0, 0.0), 0.25, tuple((counts + 2).tolist()))
    found = received(grid, *walls, 96, shares_of(grid, *walls))
    assert found.mean() == pytest.approx(1, abs=0.05)


def test_a_block_in_a_white_room_receives_what_it_sends_out():
    """So do the walls. Where nothing blocks light, it goes through the block and lights it from within."""
    counts = (12, 12, 8)
    low, high = np.array((4, 4, 0)), np.array((8, 8, 4))
    grid = Grid((0.0, 0.0, 0.0), 0.25, counts)
    walls, block = (
        box_sides((0, 0, 0), counts, 0.25, inwards=True),
        box_sides(low, high, 0.25, inwards=False),
    )
    kept = []
    for points, normals in (walls, block):
        under = (points[:, 2] == 0) & ((points > 0.25 * low)[:, :2] & (points < 0.25 * high)[:, :2]).all(
            axis=1
        )
        kept.append((points[~under], normals[~under]))
    points, normals = (np.concatenate(parts) for parts in zip(*kept, strict=True))
    of_walls = len(kept[0][0])
    free = received(grid, points, normals, 96)
    found = received(grid, points, normals, 96, shares_of(grid, points, normals))
    assert found[:of_walls].mean() == pytest.approx(1, abs=0.05)
    assert found[of_walls:].mean() == pytest.approx(1, abs=0.1)
    assert free[of_walls:].mean() > 1.3


def sheet(place, normal, parts=4):
    """A sheet across a grid of (6, 3, 3) cells of 1 m: points, normals and areas of its pieces."""
    ticks = (np.arange(3 * parts) + 0.5) / parts
    y, z = (part.ravel() for part in np.meshgrid(ticks, ticks))
    points = np.stack([np.full(len(y), place), y, z], axis=1)
    return points, np.tile(np.array(normal, dtype=float), (len(y), 1)), np.full(len(y), parts**-2.0)


ACROSS = Grid((0.0, 0.0, 0.0), 1.0, (6, 3, 3))


@pytest.mark.parametrize("place", [2.6, 3.0, 3.4])
@pytest.mark.parametrize(("travel", "into"), [(1.0, 3), (-1.0, 2)])
def test_a_wall_blocks_what_comes_towards_its_front(place, travel, into):
    """On the nearest face between cells, whole; what passes along it, and what comes from behind, goes on."""
    shares = passing(ACROSS, *sheet(place, (-travel, 0, 0))).reshape(6, 3, 3, 6)
    expected = np.ones_like(shares)
    expected[AXES.index((travel, 0.0, 0.0)), :, :, into] = 0
    np.testing.assert_allclose(shares, expected, atol=1e-6)


def test_a_tilted_piece_covers_what_it_is_seen_as():
    points, normals, _ = sheet(3.0, (-0.6, 0.0, 0.8), parts=1)
    shares = passing(ACROSS, points + np.array([0, 0, 0.2]), normals, np.full(len(points), 0.5)).reshape(
        6, 3, 3, 6
    )
    assert shares[AXES.index((1.0, 0.0, 0.0)), :, :, 3] == pytest.approx(0.7)
    assert shares[AXES.index((0.0, 0.0, -1.0)), :, :, 3] == pytest.approx(0.6)
    assert shares.sum() == pytest.approx(6 * ACROSS.size - 9 * 0.3 - 9 * 0.4)


def test_light_stays_on_its_side_of_a_sheet():
    """However thin it is; what passes along its faces is not weakened."""
    sides = [sheet(3.0, normal) for normal in ((-1, 0, 0), (1, 0, 0))]
    pieces = [np.concatenate(parts) for parts in zip(*sides, strict=True)]
    shares = [mi.Float(np.ascontiguousarray(share)) for share in passing(ACROSS, *pieces)]
    state = injection(ACROSS, [[0.1, 1.5, 1.5]], [[1, 0, 0]], [[1, 1, 1]])
    free, blocked = (
        values(ACROSS, spread(ACROSS.arrays, state, let_through, 32, ACROSS.size))[0]
        for let_through in (None, shares)
    )
    assert free[3:].sum() > 0.05 * free.sum()
    assert not blocked[3:].any()
    assert blocked[:2].sum() == pytest.approx(free[:2].sum(), rel=0.05)


def test_full_cover_lets_nothing_through_twice():
    """Shares stay in [0, 1] however much lies in a cell, and nothing at all covers nothing."""
    points, normals, areas = sheet(3.0, (-1, 0, 0))
    assert set(np.unique(passing(ACROSS, points, normals, 50 * areas))) == {0.0, 1.0}
    assert (passing(ACROSS, points[:0], normals[:0], areas[:0]) == 1).all()


def test_a_grid_fills_its_box_and_has_no_cell_too_many():
    low, high = np.array([-1.0, 0, 0]), np.array([3.0, 2.0, 2.5])
    grid = Grid.around(low, high, 16)
    assert grid.counts == (16, 8, 10)
    assert grid.side == pytest.approx(0.25)
    # 16 cells along the longest side are 10.4 along the last, 14 are 9.1.
    assert Grid.around(low, np.array([3.0, 2.0, 2.6]), 16).counts == (14, 7, 9)
    # A niche of .6 m behind one wall and of .1 m behind another.
    more = Grid.around(low, high, 16).reaching(low - (0.6, 0, 0.1), high)
    assert more.counts == (18, 8, 10)
    assert more.low == pytest.approx((-1.5, 0, 0))
    flat = Grid.around(np.zeros(3), np.array([1.0, 0, 0]), 8)
    assert flat.counts == (8, 1, 1)


def test_lookups_interpolate_and_end_half_a_cell_beyond_the_last():
    state = [dr.zeros(mi.Float, GRID.size) for _ in range(COMPONENTS)]
    state[0] = mi.Float(dr.arange(mi.UInt32, GRID.size) % 9)  # rises along x
    places = {0.0: 0.0, 0.125: 0.0, 0.5: 1.5, 1.0: 3.5, 2.25: 8.0, 2.35: 8.0, 2.4: 0.0, 50.0: 0.0, -50.0: 0.0}
    points = np.array([[-1.0 + x, -1.0, 1.0] for x in places], dtype=np.float32)
    found = looked_up(GRID.arrays, state, mi.Point3f(points.T.copy()), mi.Vector3f(0, 0, 1), mi.Bool(True))
    assert np.array(found.x) == pytest.approx(list(places.values()), abs=1e-5)
    assert not np.array(found.y).any()
