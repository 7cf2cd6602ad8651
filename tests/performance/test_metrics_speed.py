"""How fast the metrics are, as ratios to others measured in turn in the same run; nothing here can fail by time."""

import numpy as np
import pytest

from gibench import metrics
from tests.performance.turns import seconds

pytestmark = pytest.mark.performance


@pytest.fixture(scope="module")
def display():
    rng = np.random.default_rng(0)
    ref = rng.random((1080, 1920, 3), dtype=np.float32)
    pred = np.clip(ref + 0.1 * rng.standard_normal(ref.shape, dtype=np.float32), 0, 1)
    return pred, ref


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_ssim_at_1080p(display, dtype):
    from skimage.metrics import structural_similarity

    pred, ref = (image.astype(dtype) for image in display)
    wang = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False, "channel_axis": -1}
    ours, theirs = seconds(
        lambda: metrics.ssim(pred, ref),
        lambda: structural_similarity(ref, pred, data_range=1.0, **wang),
    )
    print(
        f"\nssim at 1080p, {dtype.__name__}: {ours / theirs:.2f} × scikit-image (wanted ≤ 1.0); "
        f"{ours:.2f} s, {theirs:.2f} s"
    )


def test_all_image_metrics_but_lpips_and_flip(display):
    pred, ref = display
    names = ["mse", "rmse", "mae", "relmse", "smape", "psnr", "ssim", "dssim"]
    (taken,) = seconds(lambda: metrics.evaluate(4 * pred, 4 * ref, metrics=names))
    print(f"\n{len(names)} metrics of one 1080p frame: {taken:.2f} s (wanted ≤ 1.5 s on two cores)")


def test_flip_at_1080p(display):
    evaluator = pytest.importorskip("flip_evaluator", reason="flip-evaluator comes with gibench[bench]")
    pred, ref = display
    ours, theirs = seconds(
        lambda: metrics.flip(pred, ref),
        lambda: evaluator.evaluate(ref.copy(), pred.copy(), "LDR", applyMagma=False),
    )
    print(f"\nflip at 1080p: {ours / theirs:.2f} × flip-evaluator; {ours:.2f} s, {theirs:.2f} s")


def test_lpips_alex_at_512(display):
    torch = pytest.importorskip("torch", reason="torch comes with gibench[bench]")
    from gibench.metrics.lpips_network import shared_network

    pred, ref = (image[:512, :512] for image in display)
    network = shared_network("alex")
    tensors = [torch.from_numpy(2 * image - 1).permute(2, 0, 1)[None].contiguous() for image in (pred, ref)]

    def bare():
        with torch.inference_mode():
            network(*tensors).item()

    ours, theirs = seconds(lambda: metrics.lpips(pred, ref), bare)
    print(
        f"\nlpips alex at 512²: {ours / theirs:.2f} × the bare network (wanted ≤ 1.1); {ours:.3f} s, {theirs:.3f} s"
    )
