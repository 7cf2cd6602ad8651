"""Rays marched through probes, against rays through the scene itself."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.light_field_probes.marching import (
    COARSE,
    HIT,
    LEAST_THICKNESS,
    MISS,
    MOST_THICKNESS,
    UNKNOWN,
    LightField,
    least_distances,
    thickness,
)
from gibench.baselines.probes.baking import ProbeSettings
from gibench.baselines.probes.maps import load_probes
from gibench.rendering.scene import load_dict
from tests.baselines.meshes import diffuse, directions, slab
from tests.baselines.probes.test_mappings import vectors
from tests.baselines.probes.test_maps import written
from tests.baselines.sites import site, where_rays_leave
from tests.rendering import scenes

SIDE = 128
GRID = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def box_probes(folder, positions=GRID, half=1.0, buried=(None, 0)):
    """Probes in an empty cube around the origin. buried: one that sees something else, and how far away it is."""

    def distance(probe, d):
        if probe == buried[0]:
            return np.full(len(d), buried[1])
        return np.linalg.norm(
            where_rays_leave(np.tile(positions[probe], (len(d), 1)), d, half)[0] - positions[probe], axis=1
        )

    def normal(probe, d):
        if probe == buried[0]:
            return -d
        face = where_rays_leave(np.tile(positions[probe], (len(d), 1)), d, half)[1]
        vector = np.zeros_like(d)
        vector[np.arange(len(d)), face[:, 0]] = -face[:, 1]
        return vector

    def doubled(function):
        return lambda probe, d: function(probe, np.asarray(d, dtype=np.float64))

    return written(
        folder,
        positions,
        "octahedral",
        (SIDE, SIDE),
        distance=(doubled(distance), np.float32),
        normal=(doubled(normal), np.float16),
    )


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    return LightField(box_probes(tmp_path_factory.mktemp("box")))


def traced(field, origin, towards, metre=1.0, coarse=True, probe=None):
    """Outcome, probe, way and texels that were looked at; of one probe alone where it is given."""
    point, direction = vectors(origin), vectors(towards)
    metre, coarse, active = mi.Float(metre), mi.Bool(coarse), mi.Bool(True)
    if probe is not None:
        outcome, way, looked = field.march(
            mi.UInt32(probe), point, direction, 1e-3 * metre, metre, active, coarse
        )
        found = outcome, mi.UInt32(probe), way, looked
    else:
        found = field.trace(point, direction, metre, active, coarse)
    return [np.array(part) for part in found]


def rays(count, half=0.95, seed=0):
    return np.random.default_rng(seed).uniform(-half, half, (count, 3)), directions(count, seed + 1)


def true_way(origin, towards, half=1.0):
    return np.linalg.norm(where_rays_leave(origin, towards, half)[0] - origin, axis=1)


@pytest.mark.parametrize("start", ["within", "at a wall", "at a probe"])
def test_in_an_empty_box_every_ray_ends_at_the_wall(box, start):
    """On a plane that fills a texel the hit is exact. At 128² less than 6 % of the texels see an edge of the box (12
    edges, 60 texels long), and there it is off by what the texel covers."""
    origin, towards = rays(20000)
    if start == "at a wall":
        origin[:, 2] = -1
        towards[:, 2] = np.abs(towards[:, 2])
    elif start == "at a probe":
        origin = GRID[np.arange(len(origin)) % 8].copy()
    expected = true_way(origin, towards)
    outcome, _, way, _ = traced(box, origin, towards)
    assert (outcome == HIT).mean() > 0.999
    error = np.abs(way - expected)
    assert (error < 2e-3).mean() > 0.94
    texel = 2 * np.sqrt(2) / SIDE * 3  # at the far corner of the room
    assert (error < texel).mean() > 0.99


def test_coarse_texels_hide_nothing(box):
    origin, towards = rays(20000, seed=3)
    quick, slow = (traced(box, origin, towards, coarse=coarse) for coarse in (True, False))
    np.testing.assert_array_equal(quick[0], slow[0])
    # Where a texel is entered differs in the last digits of the way: one in some thousand falls to the other side.
    assert (np.abs(quick[2] - slow[2]) < 1e-4).mean() > 0.998
    assert quick[3].mean() < 0.5 * slow[3].mean()


@pytest.mark.parametrize("metre", [0.01, 100.0])
def test_a_larger_scene_scales(box, tmp_path, metre):
    other = LightField(box_probes(tmp_path, GRID * metre, metre))
    origin, towards = rays(5000, seed=5)
    outcome, probe, way, _ = traced(box, origin, towards)
    scaled = traced(other, origin * metre, towards, metre)
    same = (scaled[0] == outcome) & (scaled[1] == probe)
    assert same.mean() > 0.995
    assert (np.abs(scaled[2] / metre - way)[same] < 1e-3).mean() > 0.995


def test_least_distances_bound_all_of_their_block():
    values = np.random.default_rng(0).uniform(0.5, 3, (2, 2 * COARSE, 2 * COARSE)).astype(np.float32)
    values[0, 3, COARSE + 1] = np.inf
    least = least_distances(values)
    assert least.shape == (2, 2, 2)
    spread = np.repeat(np.repeat(least, COARSE, axis=1), COARSE, axis=2)
    assert (spread <= values).all()
    assert (least[1, 1, 0] == values[1, COARSE:, :COARSE]).any()


def test_thickness():
    def found(direction, towards, normal, way, metre=1.0):
        return thickness(
            *(vectors([v]) for v in (direction, towards, normal)), mi.Float(way), mi.Float(metre)
        )[0]

    x, y = [1.0, 0, 0], [0, 1.0, 0]
    span = MOST_THICKNESS - LEAST_THICKNESS
    assert found(x, y, x, 5.0) == pytest.approx(LEAST_THICKNESS)  # not along what the probe sees
    assert found(x, x, [-1.0, 0, 0], 10.0) == pytest.approx(MOST_THICKNESS)
    assert found(x, x, y, 20.0) == pytest.approx(
        LEAST_THICKNESS + 2 * span
    )  # edge-on, and no more with the way
    assert found(x, x, [-1.0, 0, 0], 0.0) == pytest.approx(LEAST_THICKNESS + 0.05 * span)
    assert found(x, x, [-1.0, 0, 0], 300.0, 100.0) == pytest.approx(100 * (LEAST_THICKNESS + 0.3 * span))
    assert found([-1.0, 0, 0], x, x, 5.0) == pytest.approx(LEAST_THICKNESS)


def screen(folder):
    """A probe before a screen of 1 m that stands 1 m away in nothing, and one behind it."""

    def seen(probe, d):
        ahead = d[:, 0] if probe == 0 else -d[:, 0]
        with np.errstate(divide="ignore"):
            reach = np.where(ahead > 1e-6, (1 if probe == 0 else 2) / np.maximum(ahead, 1e-6), np.inf)
        at = np.where(np.isfinite(reach), reach, 0)[:, None] * d
        on_screen = np.isfinite(reach) & (np.abs(at[:, 1:]) < 0.5).all(axis=1)
        return np.where(on_screen, reach, 0)

    def normal(probe, d):
        return np.where(seen(probe, d)[:, None] > 0, [[-1.0 if probe == 0 else 1.0, 0, 0]], 0)

    return written(
        folder,
        [[0, 0, 0], [3, 0, 0]],
        "octahedral",
        (SIDE, SIDE),
        distance=(seen, np.float32),
        normal=(normal, np.float16),
    )


@pytest.mark.parametrize(
    ("origin", "towards", "expected"),
    [
        ([0.5, 2, 0.05], [0, -1, 0], MISS),  # before the screen
        ([1.5, 2, 0.05], [0, -1, 0], UNKNOWN),  # behind it, by more than a screen is thick
        ([0.3, 0.1, 0.2], [1, 0, 0], HIT),
        ([0.3, 0.1, 0.2], [-1, 0, 0], MISS),
        ([2, 0.1, 0.05], [-1, 0, 0], UNKNOWN),  # it begins in what the probe does not see
        ([1.5, 0.8, 0.05], [0, 0, 1], MISS),  # past it
        ([0, 0, 0], [1, 0, 0], HIT),
        ([0, 0, 0], [0, 0, 1], MISS),
    ],
)
def test_what_one_probe_says_of_a_screen(tmp_path, origin, towards, expected):
    field = LightField(screen(tmp_path))
    for coarse in (True, False):
        outcome, _, way, _ = traced(field, [origin], [towards], probe=0, coarse=coarse)
        assert outcome[0] == expected
        if expected == HIT:
            assert way[0] == pytest.approx(1 - origin[0], abs=1e-3)


def test_behind_the_screen_the_next_probe_knows(tmp_path):
    """From behind the screen back at it: the nearer probe sees its front alone."""
    field = LightField(screen(tmp_path))
    outcome, probe, way, _ = traced(field, [[1.4, 0.1, 0.05]], [[-1, 0, 0]])
    assert (outcome[0], probe[0]) == (HIT, 1)
    assert way[0] == pytest.approx(0.4, abs=1e-3)


@pytest.mark.parametrize("reach", [0.05, 0.0])
def test_a_probe_inside_of_a_thing_leaves_it_to_the_others(tmp_path, reach):
    """It sees the inside of a ball, or, with nothing around it (0), all of the outside.

    Of the first, rays that pass beside it say that it knows nothing; nothing can tell the second from free space.
    """
    buried = 7
    field = LightField(box_probes(tmp_path, buried=(buried, reach)))
    origin, towards = rays(4000, seed=9)
    beside = np.linalg.norm(np.cross(origin - GRID[buried], towards), axis=1) > 0.6
    origin, towards = origin[beside], towards[beside]
    alone = traced(field, origin, towards, probe=buried)[0]
    assert (alone == (UNKNOWN if reach else MISS)).all()
    outcome, probe, way, _ = traced(field, origin, towards)
    if reach:
        assert (outcome == HIT).mean() > 0.999
        assert (probe != buried).all()
        assert (np.abs(way - true_way(origin, towards)) < 2e-3).mean() > 0.94


def test_a_furnished_box_as_mitsuba_sees_it(tmp_path):
    """Probes that were baked, and things that hide parts of the box from each of them."""
    description = scenes.closed_box(0.5, 1.0)
    description["table"] = slab([-0.5, -0.4, -0.2], [0.4, 0.3, -0.1], diffuse(0.5, 0.5, 0.5))
    description["pillar"] = slab([0.5, 0.5, -1.0], [0.7, 0.7, 1.0], diffuse(0.5, 0.5, 0.5))
    scene = load_dict(description)
    probes = load_probes(
        site(scene, tmp_path), ProbeSettings(27, 192, 192, 1, mapping="octahedral"), ("distance", "normal")
    )
    origin, towards = rays(20000, half=0.9, seed=11)
    # Rays start on surfaces, as those of a method do.
    first = scene.mi_scene.ray_intersect(mi.Ray3f(mi.Point3f(vectors(origin)), vectors(towards)))
    leaving = directions(len(origin), 12)
    leaving *= np.sign(np.sum(leaving * np.array(first.n).T, axis=1, keepdims=True))
    start = np.array(first.p).T
    expected = np.array(scene.mi_scene.ray_intersect(first.spawn_ray(vectors(leaving))).t)
    outcome, _, way, _ = traced(LightField(probes), start, leaving)
    assert (outcome != MISS).all()
    assert (outcome == HIT).mean() > 0.97
    near = np.abs(way - expected) < 0.05
    assert near[outcome == HIT].mean() > 0.93
