"""Errors against a truth that is known here, from samples of it and from a reference that is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from gibench import metrics
from gibench.metrics.tone_map import display_slope

QUADRATIC = ("mse", "rmse", "relmse", "psnr", "rmse_display")
SIZE = (40, 56, 3)
EDGE = 30
EXPOSURE = 0.4


def truth(rng):
    """Smooth light with an edge, of two decades."""
    image = np.exp(gaussian_filter(rng.standard_normal(SIZE), (5, 5, 0)) * 8)
    image[:, EDGE:] *= 0.2
    return image.astype(np.float32)


def sampled(image, rng):
    """Pixels of which one in twenty found five times the light, and no bias."""
    found = rng.random(SIZE[:2])[..., None] < 0.05
    return (image * np.where(found, 5.0, 0.75 / 0.95) * rng.gamma(4, 0.25, SIZE)).astype(np.float32)


def denoised(samples):
    """Less noise, and too dark: smooth on either side of the edge, with light lost where there is most of it."""
    smooth = np.concatenate([gaussian_filter(side, (3, 3, 0)) for side in np.split(samples, [EDGE], 1)], 1)
    return (smooth * (1 - 0.15 * smooth / (smooth + 1))).astype(np.float32)


@pytest.fixture(scope="module")
def draws():
    """Truth, predictions, and what is known of the truth, of 150 independent draws of the samples."""
    rng = np.random.default_rng(0)
    image = truth(rng)
    predictions = {
        "good": image * np.float32(1.1),
        "blurred": gaussian_filter(image, (2, 2, 0)),
        "denoised as the reference is": denoised(sampled(image, rng)),
    }
    known = []
    for _ in range(150):
        samples = [sampled(image, rng) for _ in "ab"]
        known.append(metrics.Truth(tuple(samples), tuple(map(denoised, samples)), EXPOSURE))
    return image, predictions, known


def squared(name, value):
    return 10 ** (-value / 10) if name == "psnr" else value**2 if "rmse" in name else value


def mean_of(found):
    values = [one.mean_square for one in found]
    return np.mean(values), np.std(values, ddof=1) / np.sqrt(len(values))


@pytest.mark.parametrize("name", ["mse", "rmse_display"])
@pytest.mark.parametrize("pred", ["good", "blurred", "denoised as the reference is"])
def test_the_mean_is_the_error_against_the_truth(draws, name, pred):
    """Whatever the reference has wrong: an error against that is off by many times what is allowed here."""
    image, predictions, known = draws
    wanted = squared(
        name, metrics.evaluate(predictions[pred], image, metrics=[name], exposure=EXPOSURE)[name]
    )
    found, error = mean_of([one.error(name, predictions[pred]) for one in known])
    # Display values are to first order in what the reference has wrong, 15 % of the brightest.
    assert abs(found - wanted) < 4 * error + (0.05 * wanted if name == "rmse_display" else 0)
    against = [
        squared(
            name, metrics.evaluate(predictions[pred], one.reference, metrics=[name], exposure=EXPOSURE)[name]
        )
        for one in known
    ]
    assert abs(np.mean(against) - wanted) > 2 * abs(found - wanted)


@pytest.mark.parametrize("name", QUADRATIC)
def test_the_floor_is_the_error_of_the_reference_against_the_truth(draws, name):
    image, _, known = draws
    found, error = mean_of([one.error_of_reference(name) for one in known])
    true = [
        squared(name, metrics.evaluate(one.reference, image, metrics=[name], exposure=EXPOSURE)[name])
        for one in known
    ]
    assert found == pytest.approx(np.mean(true), rel=0.1, abs=4 * error)
    # The difference of two references is blind to what both have wrong.
    halves = [
        squared(name, metrics.evaluate(one.halves[0], one.reference, metrics=[name], exposure=EXPOSURE)[name])
        for one in known
    ]
    assert np.mean(halves) < 0.9 * np.mean(true)


@pytest.mark.parametrize("name", QUADRATIC)
def test_samples_without_noise_are_the_truth(draws, name):
    image, predictions, _ = draws
    known = metrics.Truth((image, image), (image, image), EXPOSURE)
    wanted = metrics.evaluate(predictions["blurred"], image, metrics=[name], exposure=EXPOSURE)[name]
    found = known.error(name, predictions["blurred"])
    # float32 tone mapping on the one side, float64 on the other
    assert found.value == pytest.approx(wanted, rel=1e-5)
    assert not found.clipped
    assert known.error_of_reference(name).value == metrics.METRICS[name].identity


def test_references_that_are_not_denoised_have_the_noise_of_their_mean(draws):
    first, second = draws[2][0].samples
    known = metrics.Truth((first, second), (first, second), EXPOSURE)
    floor = known.error_of_reference("mse").value
    assert floor == pytest.approx(0.25 * np.mean((first - second) ** 2, dtype=np.float64), rel=1e-6)


def test_weights_and_tangents_that_follow_the_samples_are_not_known(draws):
    """Of references that are not denoised only plain means of squares have no bias."""
    first, second = draws[2][0].samples
    raw = metrics.Truth((first, second), (first, second), EXPOSURE)
    assert {name for name in QUADRATIC if raw.knows(name)} == {"mse", "rmse"}
    assert all(draws[2][0].knows(name) for name in QUADRATIC)
    assert not draws[2][0].knows("mae")
    black = (np.zeros_like(first),) * 2
    assert all(metrics.Truth(black, black, EXPOSURE).knows(name) for name in QUADRATIC)


def test_an_estimate_below_zero_is_zero_and_says_so(draws):
    image = draws[0]
    around = np.float32(0.5) * image
    known = metrics.Truth((image - around, image + around), (image, image), EXPOSURE)
    for name in QUADRATIC:
        found = known.error(name, image)
        assert found.clipped
        assert found.value == metrics.METRICS[name].identity


def test_the_slope_is_that_of_the_curve():
    radiance = np.array([1e-6, 1e-3, 0.1, 1.0, 2.4999])
    for exposure in (0.4, 3e-3):
        step = 1e-6 * radiance
        rise = metrics.tone_map(
            np.stack([radiance - step, radiance + step]).reshape(2, 5, 1).repeat(3, 2), exposure
        )
        np.testing.assert_allclose(
            display_slope(radiance, exposure), (rise[1] - rise[0])[:, 0] / (2 * step), rtol=1e-4
        )
    assert display_slope(np.array([2.5, 1e9]), EXPOSURE).tolist() == [0, 0]


def test_other_metrics_and_other_shapes_are_refused(draws):
    _, predictions, known = draws
    for name in ("mae", "ssim", "flip"):
        assert not metrics.is_quadratic(name)
        with pytest.raises(metrics.UnknownMetricError, match="no mean of squares"):
            known[0].error(name, predictions["good"])
    with pytest.raises(metrics.ShapeError, match="pred has shape"):
        known[0].error("mse", predictions["good"][:-1])
    with pytest.raises(metrics.ShapeError, match="samples has shape"):
        metrics.Truth((predictions["good"][:-1],) * 2, (predictions["good"],) * 2, 1.0)
