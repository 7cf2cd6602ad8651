"""Lookups in maps that were written by hand, against NumPy."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.probes.baking import ProbeSettings
from gibench.baselines.probes.errors import ProbeError
from gibench.baselines.probes.maps import Probes
from tests.baselines.probes.test_mappings import columns, directions, vectors

SIZES = {"lat-long": (64, 32), "octahedral": (64, 64)}


def written(folder, positions, mapping="lat-long", size=None, **maps):
    """Probes with these maps: name → function of probe numbers and directions (N, 3) → (N,) or (N, 3)."""
    width, height = size or SIZES[mapping]
    settings = ProbeSettings(len(positions), width, height, 1, mapping=mapping)
    files = {"positions": folder / "positions.npy"}
    np.save(files["positions"], np.asarray(positions, dtype=np.float32))
    bare = Probes(settings, files).mapping
    row, column = np.indices((height, width)).reshape(2, -1)
    towards = columns(bare.direction(mi.Point2f(mi.Float(column + 0.5), mi.Float(row + 0.5))))
    for name, (values, dtype) in maps.items():
        files[name] = folder / f"{name}.npy"
        content = [
            np.asarray(values(probe, towards)).reshape(height, width, -1) for probe in range(len(positions))
        ]
        np.save(files[name], np.array(content).astype(dtype))
    return Probes(settings, files)


def test_nearest_probes_are_those_of_brute_force(tmp_path):
    rng = np.random.default_rng(0)
    positions = rng.uniform(-2, 2, (100, 3))
    probes = written(tmp_path, positions)
    points = rng.uniform(-3, 3, (500, 3)).astype(np.float32)
    found = np.array([np.array(which) for which in probes.nearest(mi.Point3f(points.T.copy()), 8)]).T
    away = np.linalg.norm(points[:, None] - positions.astype(np.float32), axis=2)
    np.testing.assert_array_equal(found, np.argsort(away, axis=1)[:, :8])


def test_all_probes_may_be_asked_for(tmp_path):
    probes = written(tmp_path, [[0, 0, 0], [3, 0, 0], [1, 0, 0]])
    found = [int(which[0]) for which in probes.nearest(mi.Point3f(2.9, 0, 0), 3)]
    assert found == [1, 2, 0]


@pytest.mark.parametrize("mapping", SIZES)
def test_what_is_smooth_is_interpolated_everywhere(tmp_path, mapping):
    """A linear function of the direction, over poles, seams and folds.

    Lat-long maps are smooth, so the error is of the second order in the texel's size. The octahedron has creases, where
    it is of the first: a quarter of a texel (π/64) times the slope.
    """
    slope = np.array([0.5, -1.0, 2.0])
    bound = {"lat-long": 0.01, "octahedral": 0.03}[mapping] * np.linalg.norm(slope)
    probes = written(
        tmp_path,
        [[0, 0, 0], [1, 0, 0]],
        mapping,
        distance=(lambda probe, d: 3 + (1 + probe) * d @ slope, np.float32),
    )
    d = directions()
    for probe in (0, 1):
        found = np.array(probes.bilinear("distance", mi.UInt32(probe), vectors(d)))
        np.testing.assert_allclose(found, 3 + (1 + probe) * d @ slope, atol=bound * (1 + probe))


@pytest.mark.parametrize("mapping", SIZES)
def test_weights_of_the_corners(tmp_path, mapping):
    probes = written(tmp_path, [[0, 0, 0]], mapping)
    corners = probes.corners(mi.UInt32(0), vectors(directions()))
    weights = np.array([np.array(weight) for _, weight in corners])
    assert (weights >= -1e-6).all()
    np.testing.assert_allclose(weights.sum(axis=0), 1, atol=1e-5)
    width, height = SIZES[mapping]
    assert all((np.array(texel) < width * height).all() for texel, _ in corners)


@pytest.mark.parametrize("mapping", SIZES)
def test_a_texel_is_the_one_that_the_direction_falls_into(tmp_path, mapping):
    probes = written(
        tmp_path,
        [[0, 0, 0], [0, 1, 0]],
        mapping,
        material_id=(lambda probe, d: 1000 * probe + np.arange(len(d)) % 1000, np.uint16),
        normal=(lambda probe, d: d, np.float16),
    )
    d = directions()
    texel = probes.texel(mi.UInt32(1), vectors(d))
    width, height = SIZES[mapping]
    assert (np.array(texel) // (width * height) == 1).all()
    np.testing.assert_array_equal(
        np.array(probes.fetch("material_id", texel)), 1000 + np.array(texel) % (width * height) % 1000
    )
    # Maps of directions give back the direction, to half a texel (its diagonal).
    found = columns(probes.fetch("normal", texel))
    angle = np.arccos(np.clip(np.sum(found * d, axis=1) / np.linalg.norm(found, axis=1), -1, 1))
    assert angle.max() < 0.8 * np.sqrt(2) * np.pi / 32


def test_what_is_inactive_is_zero(tmp_path):
    probes = written(tmp_path, [[0, 0, 0]], radiance=(lambda probe, d: np.ones((len(d), 3)), np.float16))
    assert not columns(probes.fetch("radiance", mi.UInt32([5, 7]), mi.Bool([False, False]))).any()
    np.testing.assert_array_equal(columns(probes.fetch("radiance", mi.UInt32([5, 7]))), 1)


def test_damaged_maps_say_what_to_do(tmp_path):
    settings = ProbeSettings(1, 8, 4, 1)
    (tmp_path / "positions.npy").write_bytes(b"not an array")
    with pytest.raises(ProbeError, match="remove the folder"):
        Probes(settings, {"positions": tmp_path / "positions.npy"})
