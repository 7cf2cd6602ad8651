"""LPIPS against a forward pass written in NumPy, and how its network comes about."""

import importlib
import pickle
import subprocess
import sys

import numpy as np
import pytest

from gibench import metrics
from gibench.metrics import lpips_network, lpips_weights
from gibench.metrics.lpips import SMALLEST

pytestmark = pytest.mark.usefixtures("lpips_ready")


def correlate(image, kernel, bias, stride, padding):
    """Convolution layer: (H, W, in) with (h, w, in, out)."""
    padded = np.pad(image, ((padding, padding), (padding, padding), (0, 0)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, kernel.shape[:2], axis=(0, 1))
    return np.einsum("yxihw,hwio->yxo", windows[::stride, ::stride], kernel, optimize=True) + bias


def pool(image):
    windows = np.lib.stride_tricks.sliding_window_view(image, (3, 3), axis=(0, 1))
    return windows[::2, ::2].max(axis=(-2, -1))


def numpy_lpips(pred, ref):
    """LPIPS alex in float64, with the linear heads that come with the weights and not those of the package."""
    file = lpips_weights.FILES["alex"]
    tensors = pickle.loads((lpips_weights.cache_folder() / file.name).read_bytes())
    layers = [tensors["AlexNet_0"][f"Conv_{i}"] for i in range(5)]
    heads = [tensors[f"NetLinLayer_{i}"]["Conv_0"]["kernel"][0, 0, :, 0] for i in range(5)]
    shift, scale = np.array([-0.030, -0.088, -0.188]), np.array([0.458, 0.448, 0.450])
    geometry = [(4, 2), (1, 2), (1, 1), (1, 1), (1, 1)]
    features = []
    for image in (pred, ref):
        x = (2 * image - 1 - shift) / scale
        features.append([])
        for index, (layer, (stride, padding)) in enumerate(zip(layers, geometry, strict=True)):
            if index in (1, 2):
                x = pool(x)
            x = np.maximum(correlate(x, layer["kernel"], layer["bias"], stride, padding), 0)
            features[-1].append(x / (np.linalg.norm(x, axis=-1, keepdims=True) + 1e-10))
    return sum((((p - r) ** 2) @ head).mean() for p, r, head in zip(*features, heads, strict=True))


@pytest.mark.parametrize("shape", [(31, 31, 3), (47, 64, 3)])
def test_equals_the_numpy_forward_pass(shape, rng):
    ref, pred = rng.random((2, *shape))
    assert metrics.lpips(pred, ref) == pytest.approx(numpy_lpips(pred, ref), rel=1e-4)


@pytest.mark.parametrize("net", SMALLEST)
def test_zero_for_equal_images_symmetric_and_growing_with_noise(net, rng):
    ref = 0.25 + 0.5 * rng.random((40, 41, 3))
    noise = rng.uniform(-0.25, 0.25, ref.shape)
    assert metrics.lpips(ref, ref, net=net) == 0
    assert metrics.lpips(ref + noise, ref, net=net) == pytest.approx(
        metrics.lpips(ref, ref + noise, net=net), rel=1e-5
    )
    values = [metrics.lpips(ref + amount * noise, ref, net=net) for amount in (0, 0.1, 0.3, 1)]
    assert values == sorted(values)


@pytest.mark.parametrize(("net", "smallest"), SMALLEST.items())
def test_smallest_image(net, smallest):
    image = np.full((smallest, smallest, 3), 0.5)
    assert metrics.lpips(image, image * 0.5, net=net) > 0
    with pytest.raises(metrics.ImageTooSmallError, match=f"LPIPS {net} needs at least {smallest}"):
        metrics.lpips(image[1:], image[1:], net=net)


def test_batch_and_float16_equal_single_frames(rng):
    ref, pred = rng.random((2, 3, 33, 35, 3)).astype(np.float16)
    together = metrics.lpips(pred, ref)
    assert together.shape == (3,)
    singles = [
        metrics.lpips(p.astype(np.float32), r.astype(np.float32)) for p, r in zip(pred, ref, strict=True)
    ]
    assert together.tolist() == singles


def test_unknown_network():
    image = np.zeros((64, 64, 3))
    with pytest.raises(metrics.RangeError, match="alex, vgg"):
        metrics.lpips(image, image, net="squeeze")


def test_network_is_built_once(monkeypatch):
    image = np.full((40, 40, 3), 0.5)
    metrics.lpips(image, image)
    built = lpips_network.shared_network("alex")
    monkeypatch.setattr(lpips_network, "build_network", lambda net: pytest.fail("built again"))
    metrics.lpips(image, image)
    assert lpips_network.shared_network("alex") is built


def test_network_is_frozen_and_leaves_the_random_state_alone():
    import torch

    torch.manual_seed(7)
    expected = torch.rand(3)
    torch.manual_seed(7)
    network = lpips_network.build_network("alex")
    assert torch.equal(torch.rand(3), expected)
    assert not network.training
    assert not any(parameter.requires_grad for parameter in network.parameters())
    assert not any(tensor.is_meta for tensor in [*network.parameters(), *network.buffers()])


def test_a_convolution_that_is_missing(monkeypatch):
    layers = lpips_weights.load_backbone("alex")
    monkeypatch.setattr(lpips_network, "load_backbone", lambda net: layers[:-1])
    with pytest.raises(metrics.WeightsError, match="5 convolutions and its weights 4"):
        lpips_network.build_network("alex")


def test_a_tensor_of_another_shape(monkeypatch):
    layers = lpips_weights.load_backbone("alex")
    layers[2] = (layers[2][0][:, :-1].copy(), layers[2][1])
    monkeypatch.setattr(lpips_network, "load_backbone", lambda net: layers)
    with pytest.raises(metrics.WeightsError, match=r"(?s)do not fit.*slice3"):
        lpips_network.build_network("alex")


def test_a_head_that_is_missing(monkeypatch):
    import torch

    read = torch.load

    def load_without_one(*arguments, **keywords):
        heads = read(*arguments, **keywords)
        return {name: tensor for name, tensor in heads.items() if not name.startswith("lin3")}

    monkeypatch.setattr(torch, "load", load_without_one)
    with pytest.raises(metrics.WeightsError, match=r"(?s)do not fit.*lin3"):
        lpips_network.build_network("alex")


def test_works_in_a_process_where_torchvision_failed_before():
    # Beside a CPU-only torch the first line fails, beside a matching build it succeeds; LPIPS must work in both.
    code = (
        "import contextlib\n"
        "with contextlib.suppress(RuntimeError): import torchvision\n"
        "import numpy as np\n"
        "from gibench.metrics import lpips\n"
        "print(lpips(np.zeros((40, 40, 3)), np.ones((40, 40, 3))))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) > 0


def test_a_torchvision_that_imports_is_left_as_it_is(monkeypatch):
    monkeypatch.setattr(importlib, "import_module", sys.intern)
    monkeypatch.delitem(sys.modules, lpips_network.META_REGISTRATIONS, raising=False)
    lpips_network.import_lpips()
    assert lpips_network.META_REGISTRATIONS not in sys.modules


@pytest.mark.parametrize(
    "failure", [RuntimeError("no such library"), ImportError("No module named 'torchvision'")]
)
def test_a_torchvision_that_fails_otherwise_is_reported(monkeypatch, failure):
    def fail(name):
        raise failure

    monkeypatch.setattr(importlib, "import_module", fail)
    with pytest.raises(metrics.MissingDependencyError, match=str(failure)):
        lpips_network.import_lpips()
