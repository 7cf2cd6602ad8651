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


def white_box(counts, steps, side=0.25):
    """Irradiance on the walls of a closed box whose walls all send out one W/m²: middles of their cells, (N,)."""
    grid = Grid((0.0, 0.0, 0.0), side, counts)
    extent = side * np.array(counts)
    points, normals = [], []
    for axis in range(3):
        others = [a for a in range(3) if a != axis]
        ticks = [side * (np.arange(counts[a]) + 0.5) for a in others]
        first, second = (part.ravel() for part in np.meshgrid(*ticks, indexing="ij"))
        for wall, inwards in ((0.0, 1.0), (extent[axis], -1.0)):
            place, normal = np.zeros((len(first), 3)), np.zeros((len(first), 3))
            place[:, others[0]], place[:, others[1]], place[:, axis] = first, second, wall
            normal[:, axis] = inwards
            points.append(place)
            normals.append(normal)
    points, normals = np.concatenate(points), np.concatenate(normals)
    flux = np.full((len(points), 3), side**2)
    scale = flux.sum()
    state = injection(grid, points, normals, flux / scale)
    total = spread(grid.arrays, state, None, steps, grid.size)
    at = mi.Point3f(np.ascontiguousarray((points + 0.5 * side * normals).T, dtype=np.float32))
    towards = mi.Vector3f(np.ascontiguousarray(-normals.T, dtype=np.float32))
    found = looked_up(grid.arrays, total, at, towards, mi.Bool(True))
    return np.array(found.x) * scale * EVEN / side**2


@pytest.mark.parametrize("counts", [(8, 8, 8), (12, 6, 8)])
def test_the_walls_of_a_closed_white_box_receive_what_they_send_out(counts):
    """Whatever its shape, for the form factors of a closed box add up to 1; the only factor is EVEN."""
    received = white_box(counts, 96)
    assert received.mean() == pytest.approx(1, abs=0.03)
    assert np.abs(received - 1).max() < 0.2  # corners and edges are the worst


def test_a_wall_in_the_way_blocks_light():
    grid = Grid((0.0, 0.0, 0.0), 1.0, (6, 3, 3))
    cover = np.zeros((7, 4, 4, 4), dtype=np.float32)
    cover[3, :, :, 0], cover[3, :, :, 1] = 0.25, -0.5  # faces −x
    shares = passing(grid, cover)
    assert shares.shape == (30, grid.size)
    cells = shares.reshape(30, 3, 3, 6)
    for number, (travel, ray) in enumerate(rays_of_a_step()):
        if travel == (1.0, 0.0, 0.0):
            assert cells[number, 1, 1, 3] == pytest.approx(1 - 0.25 - 0.5 * ray[0])
            assert (cells[number, 1, 1, [1, 2, 4, 5]] == 1).all()
        if travel == (-1.0, 0.0, 0.0):  # the wall's other side is not there
            assert (cells[number] == 1).all()
    state = injection(grid, [[0.1, 1.5, 1.5]], [[1, 0, 0]], [[1, 1, 1]])
    lists = [mi.Float(np.ascontiguousarray(share)) for share in shares]
    free, blocked = (
        values(grid, spread(grid.arrays, state, let_through, 5, grid.size))[0]
        for let_through in (None, lists)
    )
    assert blocked[4:].sum() < 0.4 * free[4:].sum()
    assert blocked[:2].sum() == pytest.approx(free[:2].sum(), rel=0.05)


def test_full_cover_lets_nothing_through_twice():
    """Shares stay in [0, 1] however much lies in a cell."""
    cover = np.full((3, 3, 3, 4), 50.0, dtype=np.float32)
    shares = passing(Grid((0.0, 0.0, 0.0), 1.0, (2, 2, 2)), cover)
    assert set(np.unique(shares)) <= {0.0, 1.0}


def test_a_grid_fills_its_box_and_has_no_cell_too_many():
    grid = Grid.around(np.array([-1.0, 0, 0]), np.array([3.0, 2.0, 2.6]), 16)
    assert grid.counts == (16, 8, 11)
    assert grid.side == pytest.approx(0.25)
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
