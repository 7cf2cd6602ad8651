import math

import numpy as np
import pytest

from gibench.generators.materials.noise import band_noise, lookup, smoothstep, uniform


@pytest.mark.parametrize("slope", [0.0, 1.2])
@pytest.mark.parametrize("shape", [(128, 128), (96, 160)])
def test_band_noise_is_normalized_and_periodic(shape, slope):
    field = band_noise(np.random.default_rng(0), shape, (8, 8), slope=slope)
    assert field.shape == shape
    assert field.mean() == pytest.approx(0, abs=1e-4)
    assert field.std() == pytest.approx(1, abs=1e-4)
    for axis in (0, 1):
        steps = np.abs(np.diff(field, axis=axis)).mean(axis=1 - axis)
        seam = np.abs(field.take(0, axis) - field.take(-1, axis)).mean()
        assert seam == pytest.approx(steps.mean(), rel=0.5)


def test_band_noise_is_gaussian_and_alike_everywhere():
    fields = np.array([band_noise(np.random.default_rng(seed), (64, 64), (6, 6)) for seed in range(400)])
    assert fields.std(0).mean() == pytest.approx(1, abs=0.02)
    # No texel stands out: the spread over 400 fields is known to about 3.5 %.
    assert np.abs(fields.std(0) - 1).max() < 0.2
    assert (fields**4).mean() == pytest.approx(3, abs=0.15)


def test_uniform_is_the_normal_distribution_function():
    at = np.linspace(-6, 6, 1001, dtype=np.float32)
    exact = [0.5 * math.erfc(-x / math.sqrt(2)) for x in at.tolist()]
    np.testing.assert_allclose(uniform(at), exact, atol=3e-4)


def test_band_noise_has_its_energy_where_asked():
    field = band_noise(np.random.default_rng(1), (256, 256), (10, 40), width=0.2)
    power = np.abs(np.fft.rfft2(field)) ** 2
    fv, fu = np.abs(np.fft.fftfreq(256, 1 / 256))[:, None], np.arange(129)[None, :]
    radius = np.hypot(fu / 10, fv / 40)
    assert power[(radius > 0.5) & (radius < 2)].sum() > 0.98 * power.sum()


def test_uniform_spreads_evenly():
    values = np.sort(uniform(band_noise(np.random.default_rng(2), (256, 256), (40, 40))).ravel())
    assert np.abs(values - np.linspace(0, 1, values.size)).max() < 0.03


def test_lookup_wraps():
    field = np.arange(12, dtype=np.float32).reshape(3, 4)
    assert lookup(field, np.array([-1, 3, 4]), np.array([0, 5, -1])).tolist() == [8, 1, 7]


def test_smoothstep():
    assert smoothstep(1, 3, np.array([0, 1, 2, 3, 9])) == pytest.approx([0, 0, 0.5, 1, 1])
