"""Scores that others published or computed for the LPIPS repository's example images."""

import pytest

from gibench import metrics

LPIPS = {"alex": (0.7219, 0.1376), "vgg": (0.5686, 0.4217)}
OTHERS = {
    "ssim": (0.436746, 0.295903),
    "dssim": (0.281627, 0.352048),
    "rmse": (0.125234, 0.202593),
}


@pytest.mark.parametrize("name", OTHERS)
def test_scores(examples, name):
    measured = [metrics.metric(name)(examples[image], examples["ref"]) for image in ("p0", "p1")]
    assert measured == pytest.approx(OTHERS[name], abs=1e-5)


@pytest.mark.parametrize("net", LPIPS)
def test_lpips_scores(examples, lpips_ready, net):
    measured = [metrics.lpips(examples[image], examples["ref"], net=net) for image in ("p0", "p1")]
    assert measured == pytest.approx(LPIPS[net], abs=5e-4)


@pytest.mark.parametrize("name", ["mse", "rmse", "psnr", "ssim", "dssim"])
def test_pixel_metrics_prefer_the_blurred_image(examples, name):
    metric = metrics.metric(name)
    assert metric.better(*(metric(examples[image], examples["ref"]) for image in ("p0", "p1")))


@pytest.mark.parametrize("name", ["lpips_alex", "lpips_vgg"])
def test_lpips_prefers_the_distorted_image(examples, lpips_ready, name):
    metric = metrics.metric(name)
    assert metric.better(*(metric(examples[image], examples["ref"]) for image in ("p1", "p0")))
