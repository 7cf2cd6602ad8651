"""Unstructured lumigraph: its weights in NumPy, and what blends of known maps must be."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.probes.baking import ProbeSettings
from gibench.baselines.probes.maps import load_probes
from gibench.baselines.stages import Stages
from gibench.baselines.unstructured_lumigraph import METHOD
from gibench.baselines.unstructured_lumigraph.blending import (
    BLENDED,
    HIDDEN,
    UnstructuredLumigraph,
    best_probes,
    penalty,
    sees,
    weights,
)
from gibench.rendering.camera import PinholeCamera, RayGenerator
from gibench.rendering.scene import load_dict
from tests.baselines.nearest_probe.test_lookup import SMALL, glossy_box
from tests.baselines.probes.test_mappings import columns
from tests.baselines.probes.test_maps import written
from tests.baselines.sites import RESOLUTION, site, view, where_rays_leave
from tests.rendering import scenes

GRID = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0, 0.5) for z in (-0.4, 0.4)])
"""Twelve probes in the cube of 2 m around the origin."""


SIZE = (256, 128)


def point3(values):
    return mi.Point3f(np.ascontiguousarray(np.atleast_2d(values).T, dtype=np.float32))


def surface(count=400, seed=0):
    d = np.random.default_rng(seed).normal(size=(count, 3))
    return where_rays_leave(np.zeros((count, 3)), d)[0]


def distance_in_cube(probe, d):
    hit, _ = where_rays_leave(np.tile(GRID[probe], (len(d), 1)), d.astype(float))
    return np.linalg.norm(hit - GRID[probe], axis=1)


def in_cube(folder, radiance):
    """Probes in an empty cube. radiance: of probe number and points (N, 3) on its walls."""

    def values(probe, d):
        hit, _ = where_rays_leave(np.tile(GRID[probe], (len(d), 1)), d.astype(float))
        return radiance(probe, hit)

    return written(
        folder, GRID, size=SIZE, radiance=(values, np.float32), distance=(distance_in_cube, np.float32)
    )


def off_edges(points):
    """Those that lie on the same wall as all that is within a texel and a half of them, seen from any probe."""
    good = np.ones(len(points), dtype=bool)
    turn = np.random.default_rng(9).normal(size=(24, 3))
    turn *= 1.5 * np.pi / SIZE[1] / np.linalg.norm(turn, axis=1, keepdims=True)
    for probe in GRID:
        d = points - probe
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        face = where_rays_leave(np.tile(probe, (len(d), 1)), d)[1]
        for offset in turn:
            around = where_rays_leave(np.tile(probe, (len(d), 1)), d + offset)[1]
            good &= (around == face).all(axis=1)
    assert good.mean() > 0.5
    return points[good]


def blended(probes, points, camera, candidates=16):
    return columns(
        UnstructuredLumigraph.glossy(
            probes, point3(points), mi.Point3f(*map(float, camera)), mi.Bool(True), {"candidates": candidates}
        )
    )


def test_penalty_by_hand():
    """A right angle at the point; the probe twice as far away as the camera costs .1 × ½ more."""
    value = penalty(point3([0, 0, 0]), point3([0, 2, 0]), mi.Point3f(1, 0, 0))
    assert float(value[0]) == pytest.approx(np.pi / 2 + 0.1 * 0.5)
    nearer = penalty(point3([0, 0, 0]), point3([0, 0.5, 0]), mi.Point3f(1, 0, 0))
    assert float(nearer[0]) == pytest.approx(np.pi / 2 + 0.1 * 1e-4)
    at_the_camera = penalty(point3([0, 0, 0]), point3([1, 0, 0]), mi.Point3f(1, 0, 0))
    assert 0 < float(at_the_camera[0]) == pytest.approx(1e-5, abs=1e-6)
    on_the_point = penalty(point3([0, 0, 0]), point3([0, 0, 0]), mi.Point3f(1, 0, 0))
    assert np.isfinite(float(on_the_point[0]))


def of(*penalties):
    return [float(weight[0]) for weight in weights([mi.Float(value) for value in penalties])]


def test_weights_by_hand():
    p = np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    expected = (1 - p[:4] / p[4]) / p[:4]
    np.testing.assert_allclose(of(*p), expected / expected.sum(), rtol=1e-5)


def test_a_probe_comes_in_without_a_step():
    """As it overtakes the fifth, the fourth weighs next to nothing."""
    assert of(0.1, 0.2, 0.3, 0.5, 0.5)[3] < 1e-4


def test_equal_probes_weigh_the_same():
    np.testing.assert_allclose(of(*[0.3] * 5), 0.25, rtol=1e-6)


def test_hidden_probes_count_only_where_none_is_seen():
    found = of(0.1, 0.2, HIDDEN + 0.01, HIDDEN + 0.02, HIDDEN + 0.03)
    assert found[2:] == [0, 0]
    assert sum(found) == pytest.approx(1)
    lost = of(*(HIDDEN + value for value in (0.1, 0.2, 0.3, 0.4, 0.5)))
    np.testing.assert_allclose(lost, of(0.1, 0.2, 0.3, 0.4, 0.5), rtol=1e-3)


def test_the_best_are_those_of_brute_force(tmp_path):
    probes = in_cube(tmp_path, lambda probe, hit: np.zeros((len(hit), 3)))
    points, camera = off_edges(surface()), np.array([0.1, 0.2, -0.3])
    everything = mi.UInt32(np.arange(len(GRID)))
    found = best_probes(
        probes,
        everything,
        mi.UInt32(len(GRID)),
        point3(points),
        mi.Point3f(*map(float, camera)),
        mi.Bool(True),
    )
    to_probe, to_camera = GRID[None] - points[:, None], (camera - points)[:, None]
    far, near = np.linalg.norm(to_probe, axis=2), np.linalg.norm(to_camera, axis=2)
    angle = np.arccos(np.clip(np.sum(to_probe * to_camera, axis=2) / (far * near), -1, 1))
    expected = angle + 0.1 * np.maximum(1e-4, (far - near) / far)
    # In an empty cube every probe sees every wall.
    ordered = np.sort(expected, axis=1)[:, : BLENDED + 1]
    values = np.array([np.array(value) for value in found[0]]).T
    np.testing.assert_allclose(values, ordered, atol=1e-4)
    which = np.array([np.array(value) for value in found[1]]).T
    np.testing.assert_allclose(np.take_along_axis(expected, which, axis=1), ordered, atol=1e-4)


def test_visibility(tmp_path):
    """A probe sees walls at any angle; not a point in front of one or behind one."""
    probes = in_cube(tmp_path, lambda probe, hit: np.zeros((len(hit), 3)))
    points = off_edges(surface())
    for probe in range(len(GRID)):
        which = mi.UInt32(probe)
        assert np.array(sees(probes, which, point3(points), mi.Bool(True))).all()
        for off in (0.9, 1.1):
            moved = GRID[probe] + off * (points - GRID[probe])
            assert not np.array(sees(probes, which, point3(moved), mi.Bool(True))).any()


def test_light_that_does_not_depend_on_the_direction_is_reproduced(tmp_path):
    """What every probe sees alike on a wall comes back from any camera, as far as texels resolve it."""

    def matte(probe, hit):
        return np.stack([2 + hit[:, 0], 2 + hit[:, 1], 2 + hit[:, 2]], axis=1)

    probes = in_cube(tmp_path, matte)
    points = surface()
    for camera in ((0, 0, 0), (0.7, -0.8, 0.6)):
        np.testing.assert_allclose(blended(probes, points, camera), matte(0, points), atol=0.05)


def test_a_camera_at_a_probe_reproduces_it(tmp_path):
    """However unlike the others are (epipole consistency, one of the goals of Buehler et al.)."""
    probes = in_cube(tmp_path, lambda probe, hit: np.full((len(hit), 3), 1.0 + probe))
    points = off_edges(surface())
    for probe in (0, 5, 11):
        np.testing.assert_allclose(blended(probes, points, GRID[probe]), 1.0 + probe, rtol=2e-3)


def test_where_no_probe_sees_the_point_they_are_blended_as_if_all_did(tmp_path):
    probes = in_cube(tmp_path, lambda probe, hit: np.full((len(hit), 3), 1.0 + probe))
    outside, camera = np.array([[0.2, 0.1, 3.0], [4.0, 0.3, 0.1]]), np.array([0.1, 0.0, 0.0])
    found = blended(probes, outside, camera)
    to_probe, to_camera = GRID[None] - outside[:, None], (camera - outside)[:, None]
    far, near = np.linalg.norm(to_probe, axis=2), np.linalg.norm(to_camera, axis=2)
    angle = np.arccos(np.clip(np.sum(to_probe * to_camera, axis=2) / (far * near), -1, 1))
    p = angle + 0.1 * np.maximum(1e-4, (far - near) / far)
    order = np.argsort(p, axis=1)[:, : BLENDED + 1]
    best = np.take_along_axis(p, order, axis=1)
    share = np.maximum(1 - best[:, :BLENDED] / best[:, BLENDED:], 1e-6) / best[:, :BLENDED]
    expected = (share * (1.0 + order[:, :BLENDED])).sum(axis=1) / share.sum(axis=1)
    np.testing.assert_allclose(found[:, 0], expected, rtol=2e-2)


def test_fewer_probes_than_are_blended(tmp_path):
    probes = written(
        tmp_path,
        GRID[:2],
        radiance=(lambda probe, d: np.full((len(d), 3), 1.0 + probe), np.float32),
        distance=(distance_in_cube, np.float32),
    )
    found = blended(probes, surface(), (0.0, 0.0, 0.0))
    assert ((found >= 1 - 1e-5) & (found <= 2 + 1e-5)).all()


def test_the_method_at_a_probe(tmp_path):
    """From bakes to pixels: a camera at a probe shows the probe's glossy light, and the matte parts have none."""
    scene = load_dict(glossy_box())
    where = site(scene, tmp_path)
    method = METHOD.load()(METHOD.settings(SMALL))
    method.prepare(where)
    probes = load_probes(where, ProbeSettings(8, 64, 32, 4), ("radiance",))
    position = columns(probes.position(mi.UInt32(2)))[0]
    camera = PinholeCamera(tuple(map(float, position)), (-0.1, 0.2, -1.0), 0.8)
    stages = Stages()
    found = method.render(view(camera), stages)
    assert set(stages.seconds) == {"g-buffer", "gather"}
    x, y = np.meshgrid(np.arange(RESOLUTION[0]) + 0.5, np.arange(RESOLUTION[1]) + 0.5)
    rays = RayGenerator(camera, RESOLUTION).rays(mi.Point2f(mi.Float(x.ravel()), mi.Float(y.ravel())))
    expected = columns(probes.bilinear("radiance", mi.UInt32(2), rays.d)).reshape(found.specular.shape)
    floor = (np.array(scene.mi_scene.ray_intersect(rays).p)[2] < -0.999).reshape(expected.shape[:2])
    inner = floor & (np.abs(np.array(scene.mi_scene.ray_intersect(rays).p)[:2]).max(axis=0) < 0.85).reshape(
        floor.shape
    )
    assert inner.mean() > 0.3
    np.testing.assert_allclose(found.specular[inner], expected[inner], rtol=0.02, atol=1e-3)
    assert not found.specular[~floor].any()


def test_without_gloss_specular_is_zero(tmp_path):
    method = METHOD.load()(METHOD.settings(SMALL))
    method.prepare(site(load_dict(scenes.closed_box(0.5, 1.0)), tmp_path))
    found = method.render(view(PinholeCamera((0.1, 0, 0), (1, 0.2, 0.1), 1.0)), Stages())
    assert not found.specular.any()


def test_other_numbers_of_candidates_need_no_new_preparation(tmp_path):
    method = METHOD.load()(METHOD.settings(SMALL))
    method.prepare(site(load_dict(glossy_box()), tmp_path))
    camera = PinholeCamera((0.1, 0, 0), (0.4, 0.2, -0.9), 1.0)
    frames = []
    for candidates in (8, 64, 8):
        method.adjust(METHOD.settings(SMALL | {"candidates": candidates}))
        frames.append(method.render(view(camera), Stages()).specular)
    np.testing.assert_array_equal(frames[0], frames[2])
