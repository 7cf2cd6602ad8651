"""The search in probes that were written by hand: a floor and a ball that mirror a ceiling."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.glossy_probe_reprojection.gather import (
    NOTHING,
    OTHER_SURFACE,
    Search,
    TexelTable,
    Wanted,
    best_sample,
    gathered,
    trilinear,
)
from gibench.baselines.glossy_probe_reprojection.perturbation import Mirror
from gibench.rendering.camera import PinholeCamera
from tests.baselines.efficient_light_probes.test_search import floor, rays, vectors
from tests.baselines.probes.test_mappings import columns
from tests.baselines.probes.test_maps import written

SIZE = (24, 18)
ABOVE = PinholeCamera((0.3, -2.0, 2.5), (0.0, 0.2, 0.0), 1.0)
CEILING = 4.0
PAINT, FLOOR, OTHER = 2, 1, 3


def under_a_ceiling(points, directions):
    """Where rays that go up end, (N, 3)."""
    return points + directions * ((CEILING - points[:, 2:]) / np.maximum(directions[:, 2:], 1e-6))


def stripes(points):
    """The color of the ceiling."""
    return np.stack([0.5 + 0.5 * np.sin(points[:, 0]), 0.5 + 0.5 * np.cos(points[:, 1]), 0 * points[:, 0]], 1)


def floor_table(folder, positions, floors=None, ceilings=None, size=(512, 256)):
    """Probes over a mirror, the plane z = 0, under a striped ceiling. floors, ceilings: materials, one a probe."""

    def hit(probe, directions):
        origin = np.tile(positions[probe], (len(directions), 1)).astype(float)
        down = np.where(directions[:, 2:] < -1e-3, directions[:, 2:], -1.0)
        points = origin - directions * origin[:, 2:] / down
        return points, directions[:, 2] < -1e-3

    def mirrored(probe, directions):
        points, _ = hit(probe, directions)
        return under_a_ceiling(points, directions * [1, 1, -1])

    def on_floor(value):
        return lambda probe, directions: np.where(hit(probe, directions)[1], value(probe), 0)

    probes = written(
        folder,
        positions,
        size=size,
        radiance=(lambda probe, d: stripes(mirrored(probe, d)) * hit(probe, d)[1][:, None], np.float16),
        distance=(lambda probe, d: np.linalg.norm(hit(probe, d)[0] - positions[probe], axis=1), np.float32),
        normal=(lambda probe, d: np.tile([0, 0, 1.0], (len(d), 1)), np.float16),
        material_id=(on_floor(lambda probe: (floors or {}).get(probe, FLOOR)), np.uint16),
        reflected_position=(mirrored, np.float32),
        reflected_material_id=(on_floor(lambda probe: (ceilings or {}).get(probe, PAINT)), np.uint16),
    )
    return TexelTable(probes)


def seen(camera=ABOVE):
    """What a camera sees of that floor, and the color of it."""
    origins, directions = rays(camera, SIZE)
    points, normals, _ = floor(origins, directions)
    target = under_a_ceiling(points, directions * [1, 1, -1])
    count = len(points)
    mirror = Mirror(
        vectors(mi.Point3f, points),
        vectors(mi.Vector3f, normals),
        vectors(mi.Vector2f, np.zeros((count, 2))),
        vectors(mi.Vector3f, np.zeros((count, 3))),
    )
    wanted = Wanted(
        mirror,
        mi.UInt32(np.full(count, FLOOR)),
        vectors(mi.Point3f, target),
        mi.Bool(np.zeros(count, dtype=bool)),
        mi.UInt32(np.full(count, PAINT)),
    )
    return wanted, stripes(target)


def how(order=2, window=7, levels=2, unit=1.0):
    search = Search(mi.UInt32(order), mi.UInt32(window), mi.UInt32(levels), mi.Float(unit))
    dr.make_opaque(search)
    return search


def everywhere():
    return mi.Bool(np.ones(SIZE[0] * SIZE[1], dtype=bool))


def sample(table, number=0, camera=ABOVE, **knobs):
    """Energies of the best samples of a probe, and how far what they mirror is from what is wanted, m."""
    wanted, _ = seen(camera)
    probe = dr.opaque(mi.UInt32, number)
    eye = mi.Point3f(list(camera.position))
    energy, at = best_sample(table, probe, wanted, eye, how(**knobs), everywhere())
    there = table.mirrored(table.probes.texel_at(probe, at), True)
    return np.array(energy), np.array(dr.norm(there - wanted.target))


def gather(table, shares, camera=ABOVE, **knobs):
    wanted, _ = seen(camera)
    color, energy = gathered(
        table,
        mi.UInt32(np.arange(len(shares))),
        mi.Float(np.asarray(shares, dtype=np.float32)),
        dr.opaque(mi.UInt32, len(shares)),
        wanted,
        mi.Point3f(list(camera.position)),
        how(**knobs),
        everywhere(),
    )
    return columns(color), np.array(energy)


def test_a_probe_at_the_camera_shows_what_it_holds(tmp_path):
    color, energy = gather(floor_table(tmp_path, [ABOVE.position]), [1.0])
    np.testing.assert_allclose(color, seen()[1], atol=0.02)
    assert np.median(energy) < 0.06  # half a texel, where what is mirrored is 8 m from its image in the floor


def test_reflections_move_with_the_camera(tmp_path):
    """What a probe beside the camera mirrors at the place that was found is what the camera does."""
    table = floor_table(tmp_path, [(-0.4, -1.5, 1.9)])
    _, apart = sample(table)
    # Texels of π / 256, at up to 8 m and more from what is mirrored, and one of them from the best of the fine grid.
    assert np.median(apart) < 0.1
    assert (apart < 0.3).all()
    np.testing.assert_allclose(gather(table, [1.0])[0], seen()[1], atol=0.1)


def test_each_part_of_the_search_finds_better_samples(tmp_path):
    table = floor_table(tmp_path, [(-1.0, -0.9, 1.2)])

    def mean(**knobs):
        return sample(table, **knobs)[0].mean()

    assert mean() < mean(levels=1) < mean(levels=1, window=1, order=1)
    assert mean(order=1, window=1) < mean(order=0, window=1)
    assert mean(order=0, window=7) < mean(order=0, window=3)


def test_the_energy_is_that_of_equation_1(tmp_path):
    """Of texels anywhere, against NumPy."""
    table = floor_table(tmp_path, [(0.1, -1.0, 1.5)], ceilings={0: OTHER}, size=(64, 32))
    wanted, _ = seen()
    rng = np.random.default_rng(0)
    texel = rng.integers(64 * 20, 64 * 32, SIZE[0] * SIZE[1])
    found = np.array(table.energy(mi.UInt32(texel), wanted, wanted.direction, mi.Float(2.0), everywhere()))
    probes = table.probes
    centre = np.stack([texel % 64 + 0.5, texel // 64 + 0.5])
    towards = columns(probes.direction(mi.UInt32(0), mi.Point2f(centre.astype(np.float32))))
    index = mi.UInt32(texel)
    point = [0.1, -1.0, 1.5] + towards * np.array(probes.fetch("distance", index))[:, None]
    mirrored = columns(probes.fetch("reflected_position", index))
    target, own = columns(wanted.target), columns(wanted.mirror.point)
    there, here = mirrored - point, target - own
    cosine = np.sum(there * here, axis=1) / np.linalg.norm(there, axis=1) / np.linalg.norm(here, axis=1)
    expected = np.minimum(np.linalg.norm(mirrored - target, axis=1) / 2, 1) + np.minimum(1 - cosine, 1)
    np.testing.assert_allclose(found, OTHER_SURFACE * expected, rtol=1e-3, atol=2e-3)


def test_samples_of_another_surface_do_not_count(tmp_path):
    """A probe behind a wall shows the wall: the others stand in for it, and where there is none, nothing is known."""
    positions = [ABOVE.position, (-0.4, -1.5, 1.9)]
    table = floor_table(tmp_path, positions, floors={1: OTHER})
    both, energy = gather(table, [0.2, 0.8])
    np.testing.assert_allclose(both, gather(table, [1.0])[0], atol=1e-6)
    assert (energy < NOTHING).all()
    nothing, energy = gather(floor_table(tmp_path, positions[:1], floors={0: OTHER}), [1.0])
    assert not nothing.any()
    assert (energy >= NOTHING).all()


def test_samples_that_mirror_another_surface_count_where_there_are_no_others(tmp_path):
    """Their energy is ten times as large, which the falloff turns into a weight of next to nothing."""
    positions = [ABOVE.position, ABOVE.position]
    table = floor_table(tmp_path, positions, ceilings={1: OTHER})
    alone = sample(table, 1)[0]
    np.testing.assert_allclose(alone, OTHER_SURFACE * sample(table, 0)[0], rtol=1e-3, atol=1e-4)
    color, energy = gather(floor_table(tmp_path, positions[:1], ceilings={0: OTHER}), [1.0])
    np.testing.assert_allclose(color, seen()[1], atol=0.05)
    assert (energy < NOTHING).all()


def test_a_probe_under_the_floor_stays_finite(tmp_path):
    color, energy = gather(floor_table(tmp_path, [(0.0, 0.0, -1.0), (0.0, 0.0, 0.0)]), [0.5, 0.5])
    assert np.isfinite(color).all()
    assert np.isfinite(energy).all()


GRID = np.stack(np.meshgrid([0, 1.0, 2], [0, 2.0], [0, 1.0], indexing="ij"), axis=-1).reshape(-1, 3)


def by_probe(positions, eye, count=8):
    chosen, shares = trilinear(positions, eye, count)
    weights = np.zeros(len(positions))
    weights[chosen] = shares
    return weights


def test_weights_are_trilinear():
    eye = np.array([0.3, 0.5, 0.9])
    expected = np.maximum(1 - np.abs(GRID - eye) / [1, 2, 1], 0).prod(axis=1)
    np.testing.assert_allclose(by_probe(GRID, eye), expected, atol=0.06)
    np.testing.assert_allclose(by_probe(GRID, GRID[5])[5], 1, atol=0.07)


@pytest.mark.parametrize("gap", [None, 0, 7])
def test_weights_change_without_a_jump(gap):
    """Along a way through the grid and out of it, with a probe missing too."""
    positions = GRID if gap is None else np.delete(GRID, gap, axis=0)
    way = np.linspace([-0.5, -0.5, -0.2], [2.5, 2.3, 1.4], 3001)
    weights = np.array([by_probe(positions, eye) for eye in way])
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-5)
    assert np.abs(np.diff(weights, axis=0)).max() < (0.01 if gap is None else 0.05)


@pytest.mark.parametrize("scale", [0.01, 100])
def test_weights_do_not_know_the_size_of_the_scene(scale):
    eye = np.array([1.3, 0.5, 0.4])
    np.testing.assert_allclose(by_probe(GRID * scale, eye * scale), by_probe(GRID, eye), rtol=1e-4)


def test_a_lone_probe_and_a_row_of_them():
    np.testing.assert_allclose(by_probe(np.array([[1.0, 2, 3]]), (9, 9, 9), 1), [1])
    row = np.array([[0.0, 0, 1], [1, 0, 1], [2, 0, 1]])
    np.testing.assert_allclose(by_probe(row, (0.25, 5, 0), 3), [0.75, 0.25, 0], atol=0.03)
