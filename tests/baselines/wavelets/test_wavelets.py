"""The Haar transform against its closed forms, and how much of real light few wavelets keep."""

import numpy as np
import pytest
import torch

from gibench.baselines.wavelets.haar import WaveletError, haar, inverse_haar, supports
from gibench.baselines.wavelets.selection import POWERS, energy_kept, largest, only, replaced
from gibench.generators.environments.files import environment_files, read_environment
from gibench.rendering.cubemap import to_cubemap


def faces(size, seed=0):
    return np.random.default_rng(seed).normal(size=(6, size, size, 3))


@pytest.mark.parametrize("size", [1, 2, 16, 64])
def test_energy_is_kept_and_the_picture_comes_back(size):
    image = faces(size)
    coefficients = haar(image)
    assert (coefficients**2).sum() == pytest.approx((image**2).sum(), rel=1e-12)
    np.testing.assert_allclose(inverse_haar(coefficients), image, atol=1e-12)
    np.testing.assert_array_equal(image, faces(size))  # which is left as it was


def test_it_is_linear_and_two_by_two_is_as_defined():
    a, b, c, d = 5.0, 3.0, 2.0, 1.0
    result = haar(np.array([[a, b], [c, d]])[..., None])[..., 0]
    expected = [[(a + b + c + d) / 2, (a - b + c - d) / 2], [(a + b - c - d) / 2, (a - b - c + d) / 2]]
    np.testing.assert_allclose(result, expected)
    one, other = faces(16, 1), faces(16, 2)
    np.testing.assert_allclose(haar(2 * one - other), 2 * haar(one) - haar(other), atol=1e-12)


def test_a_constant_has_one_coefficient_a_face():
    result = haar(np.full((6, 64, 64, 1), 0.5))
    assert np.count_nonzero(result) == 6
    np.testing.assert_allclose(result[:, 0, 0], 0.5 * 64)


def test_the_picture_of_a_single_wavelet():
    coefficients = np.zeros((8, 8, 1))
    coefficients[1, 2] = 1.0  # of h = 2: sums across, columns 0 and 1 of the right upper quarter, row 1
    picture = inverse_haar(coefficients)[..., 0]
    expected = np.zeros((8, 8))
    expected[4:8, 0:2], expected[4:8, 2:4] = 0.25, -0.25
    np.testing.assert_allclose(picture, expected)


@pytest.mark.parametrize("size", [2, 8, 32])
def test_supports_are_where_wavelets_are_not_zero(size):
    wavelets = np.eye(size * size).reshape(size * size, size, size, 1)
    counted = (np.abs(inverse_haar(wavelets)) > 1e-9).sum(axis=(1, 2, 3)).reshape(size, size)
    np.testing.assert_array_equal(supports(size), counted)


def test_tensors_give_what_arrays_give():
    image = faces(32)
    tensor = haar(torch.tensor(image))
    np.testing.assert_allclose(tensor.numpy(), haar(image), atol=1e-12)
    np.testing.assert_allclose(inverse_haar(tensor).numpy(), image, atol=1e-12)


def test_the_largest_come_first_and_weights_count():
    coefficients = np.zeros((1, 4, 4, 3))
    coefficients[0, 0, 0] = 0.9  # support 16: |c| 2.7, |c|·√A 10.8, |c|·A 43.2
    coefficients[0, 3, 3] = [0.0, 6.0, 0.0]  # support 4: |c| 6, |c|·√A 12, |c|·A 24
    coefficients[0, 0, 1] = [1.0, 1.0, 1.5]  # support 16: 3.5, 14, 56
    assert largest(coefficients, 3).tolist() == [15, 1, 0]
    assert largest(coefficients, 3, "root-area").tolist() == [1, 15, 0]
    assert largest(coefficients, 3, "area").tolist() == [1, 0, 15]
    kept = only(coefficients, largest(coefficients, 1))
    assert np.count_nonzero(kept) == 1
    assert energy_kept(coefficients, largest(coefficients, 1)) == pytest.approx(36 / (36 + 3 * 0.81 + 4.25))
    assert energy_kept(np.zeros((4, 4, 3)), np.array([0])) == 1.0


@pytest.mark.parametrize("weighting", POWERS)
@pytest.mark.parametrize("count", [1, 7, 383, 384])
def test_of_equal_ones_the_smaller_places_are_chosen(weighting, count):
    """As sorting all of them would have it; digits are few, so that many are equal."""
    coefficients = np.random.default_rng(count).normal(size=(6, 8, 8, 3)).round(1)
    magnitude = np.abs(coefficients).sum(axis=-1) * supports(8) ** POWERS[weighting]
    expected = np.argsort(-magnitude.ravel(), kind="stable")[:count]
    np.testing.assert_array_equal(largest(coefficients, count, weighting), expected)
    np.testing.assert_array_equal(largest(np.zeros((6, 8, 8, 3)), count, weighting), np.arange(count))


def test_without_weights_no_other_choice_keeps_more_energy():
    coefficients = haar(faces(16, 4)[..., :1])
    best = energy_kept(coefficients, largest(coefficients, 40))
    for weighting in ("root-area", "area"):
        assert energy_kept(coefficients, largest(coefficients, 40, weighting)) <= best
    rest = inverse_haar(coefficients - only(coefficients, largest(coefficients, 40)))
    assert (rest**2).sum() == pytest.approx((1 - best) * (coefficients**2).sum())


@pytest.mark.parametrize("shape", [(3, 3, 1), (4, 8, 1), (4, 4), (0, 0, 3)])
def test_what_has_no_transform(shape):
    with pytest.raises(WaveletError, match="S a power of 2"):
        haar(np.zeros(shape))


def test_selections_that_cannot_be_made():
    with pytest.raises(WaveletError, match="17 wavelets of 16"):
        largest(np.zeros((4, 4, 1)), 17)
    with pytest.raises(WaveletError, match="no weighting 'size': choose from none, root-area, area"):
        largest(np.zeros((4, 4, 1)), 1, "size")


def test_few_wavelets_keep_most_of_real_light():
    """Outdoor maps, with their suns, need fewer wavelets for the same share of energy than indoor maps."""
    kept = {}
    for place in ("indoor", "outdoor"):
        shares = []
        for entry in environment_files(place):
            coefficients = haar(to_cubemap(read_environment(entry.path), 64).astype(np.float64))
            shares.append(energy_kept(coefficients, largest(coefficients, 64)))
        kept[place] = np.mean(shares)
    assert 0.7 < kept["indoor"] < 0.9
    assert 0.9 < kept["outdoor"] < 1.0


def test_the_share_of_wavelets_that_are_new():
    before = np.array([7, 1, 4, 2])
    assert replaced(np.array([2, 7, 4, 1]), before) == 0
    assert replaced(np.array([2, 7, 5, 3]), before) == 0.5
    assert replaced(before, np.zeros(0, dtype=np.int64)) == 1
    assert replaced(np.zeros(0, dtype=np.int64), before) == 0
