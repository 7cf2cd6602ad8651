"""Losses against the metrics, plain NumPy, closed forms and published sizes."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from gibench.baselines.training.display import displayed
from gibench.baselines.training.errors import TrainingError
from gibench.baselines.training.losses.adversarial import PatchGan, fooling, judging
from gibench.baselines.training.losses.perceptual import RELU, Lpips, Vgg16Features
from gibench.baselines.training.losses.pixels import absolute, averaged, smooth_absolute
from gibench.metrics import lpips, tone_map
from gibench.metrics.lpips_network import build_network
from gibench.metrics.lpips_weights import load_backbone, weights_state

with_weights = pytest.mark.skipif(
    weights_state().state != "cached", reason="the weights of LPIPS are not here"
)


def image(seed, size=(40, 48), count=2):
    generator = torch.Generator().manual_seed(seed)
    return torch.rand(count, 3, *size, generator=generator)


def test_pixel_losses_are_torchs_own_where_all_pixels_count():
    a, b = 5 * image(0), 5 * image(1)
    torch.testing.assert_close(absolute(a, b), torch.nn.functional.l1_loss(a, b))
    for bend in (0.3, 1.0):
        torch.testing.assert_close(
            smooth_absolute(a, b, bend=bend),
            bend / bend * torch.nn.functional.smooth_l1_loss(a, b, beta=bend),
        )


def test_masked_pixels_do_not_count_whatever_they_hold():
    a, b = image(0), image(1)
    mask = (image(2)[:, :1] > 0.5).float()
    expected = (a - b).abs().numpy()[np.broadcast_to(mask.numpy() > 0, a.shape)].mean()
    a = torch.where(mask > 0, a, math.nan).requires_grad_(True)
    found = absolute(a, b, mask)
    assert float(found.detach()) == pytest.approx(expected, rel=1e-6)
    assert averaged(image(0), torch.zeros(2, 1, 40, 48)) == 0
    weighted = averaged(torch.tensor([1.0, 3.0]), torch.tensor([3.0, 1.0]))
    assert float(weighted) == pytest.approx(1.5)


@with_weights
def test_lpips_is_the_metric():
    a, b = image(0), image(1)
    expected = lpips(a.permute(0, 2, 3, 1).numpy(), b.permute(0, 2, 3, 1).numpy(), net="vgg")
    assert float(Lpips()(a, b)) == pytest.approx(np.mean(expected), rel=1e-5)
    assert float(Lpips()(a, a)) == 0


@with_weights
def test_the_gradient_of_lpips_leads_downhill():
    loss, truth = Lpips(), image(1, (32, 32), 1)
    found = image(0, (32, 32), 1).requires_grad_(True)
    before = loss(found, truth)
    before.backward()
    assert torch.isfinite(found.grad).all()
    after = loss((found - 1e-3 * found.grad / found.grad.norm()).detach(), truth)
    assert float(after) < float(before.detach())


@with_weights
def test_features_are_those_of_vgg16_layer_by_layer():
    """Its layers once more, from the stored convolutions alone."""
    a, b = image(0), image(1)
    shift, scale = np.array([-0.030, -0.088, -0.188]), np.array([0.458, 0.448, 0.450])

    def features(x):
        x = torch.from_numpy((np.moveaxis(2 * x.numpy() - 1, 1, -1) - shift) / scale).movedim(-1, 1).float()
        found, blocks = {}, (2, 2, 3, 3, 3)
        convolutions = iter(load_backbone("vgg"))
        for block, count in enumerate(blocks, 1):
            for layer in range(1, count + 1):
                kernel, bias = (torch.from_numpy(part) for part in next(convolutions))
                x = torch.relu(torch.nn.functional.conv2d(x, kernel, bias, padding=1))
                found[f"relu{block}_{layer}"] = x
            x = torch.nn.functional.max_pool2d(x, 2)
        return found

    ours, theirs = features(a), features(b)
    weights = {"relu1_1": 0.5, "relu3_1": 2.0, "relu5_1": 1.0}
    expected = sum(
        weight * float((ours[name] - theirs[name]).abs().mean()) for name, weight in weights.items()
    )
    assert float(Vgg16Features(weights)(a, b)) == pytest.approx(expected, rel=1e-5)
    for name in RELU:
        alone = float((ours[name] - theirs[name]).abs().mean())
        assert float(Vgg16Features({name: 1.0})(a, b)) == pytest.approx(alone, rel=1e-5)


@with_weights
def test_the_truth_has_no_gradient_and_the_output_the_one_that_it_has_beside_it():
    loss = Vgg16Features()
    output, truth = image(0).requires_grad_(True), image(1).requires_grad_(True)
    found = loss(output, truth)
    found.backward()
    assert truth.grad is None
    # Both through the layers at once.
    other = image(0).requires_grad_(True)
    features, total = loss.scaling(2 * torch.cat([other, image(1)]) - 1), torch.zeros(())
    for number, layer in enumerate(loss.layers):
        features = layer(features)
        if number in loss.weights:
            ours, theirs = features.chunk(2)
            total = total + loss.weights[number] * (ours - theirs).abs().mean()
    total.backward()
    assert torch.equal(found, total)
    assert torch.equal(output.grad, other.grad)


@with_weights
def test_no_more_layers_are_run_than_are_looked_at():
    network = build_network("vgg")
    assert len(network.net.slice1) == 4
    assert len(Vgg16Features({"relu1_1": 1.0}).layers) == 2
    assert len(Vgg16Features({"relu4_1": 1.0}).layers) == 19
    assert not any(p.requires_grad for p in Vgg16Features().parameters())


@with_weights
def test_what_a_perceptual_loss_cannot_look_at_is_named():
    with pytest.raises(TrainingError, match="32 pixels along each side at least, not at 31 × 64"):
        Lpips()(image(0, (64, 31)), image(1, (64, 31)))
    with pytest.raises(TrainingError, match="relu6_1"):
        Vgg16Features({"relu6_1": 1.0})
    with pytest.raises(TrainingError, match="no layer"):
        Vgg16Features({})


def test_display_values_are_those_of_the_metrics():
    radiance = np.geomspace(1e-6, 1e3, 300).reshape(10, 10, 3).astype(np.float32)
    ours = displayed(torch.from_numpy(radiance), 0.7)
    np.testing.assert_allclose(ours.numpy(), tone_map(radiance, 0.7), atol=1e-6)


def test_the_gradient_of_display_values_is_finite_at_black_and_far_above_white():
    radiance = torch.tensor([0.0, 1e-30, 1e-4, 0.5, 1.0, 1e6, 1e30], requires_grad=True)
    displayed(radiance, 2.0).sum().backward()
    assert torch.isfinite(radiance.grad).all()


def test_the_patchgan_has_its_size_and_sees_70_pixels():
    judge = PatchGan(6)
    assert sum(p.numel() for p in judge.parameters()) == 2_768_705
    assert judge(image(0, (256, 256), 1), image(1, (256, 256), 1)).shape == (1, 1, 30, 30)
    # The receptive field, without the normalisation, which sees all.
    for layer in list(judge.layers):
        if isinstance(layer, torch.nn.InstanceNorm2d):
            layer.forward = lambda x: x
    seen = image(1, (256, 256), 1).requires_grad_(True)
    judge(image(0, (256, 256), 1), seen)[0, 0, 15, 15].backward()
    rows, columns = (seen.grad[0].abs().sum(axis).nonzero()[:, -1] for axis in ((0, 2), (0, 1)))
    assert (int(rows.max() - rows.min()) + 1, int(columns.max() - columns.min()) + 1) == (70, 70)


@pytest.mark.parametrize("size", [(24, 24), (24, 100), (65, 33)])
def test_the_patchgan_judges_any_size_that_is_large_enough(size):
    logits = PatchGan(6)(image(0, size), image(1, size))
    assert torch.isfinite(logits).all()
    with pytest.raises(TrainingError, match="24 pixels"):
        PatchGan(6)(image(0, (23, 64)), image(1, (23, 64)))


def test_the_game_is_cross_entropy():
    generator = torch.Generator().manual_seed(0)
    true, made = (3 * torch.randn(2, 1, 5, 5, generator=generator) for _ in "ab")
    entropy = torch.nn.functional.binary_cross_entropy_with_logits
    expected = 0.5 * (entropy(true, torch.ones_like(true)) + entropy(made, torch.zeros_like(made)))
    torch.testing.assert_close(judging(true, made), expected)
    torch.testing.assert_close(fooling(made), entropy(made, torch.ones_like(made)))
    nothing = torch.zeros(1)
    assert float(judging(nothing, nothing)) == pytest.approx(math.log(2))
    assert torch.isfinite(judging(torch.tensor([1e30]), torch.tensor([-1e30])))


def test_a_judge_learns_to_tell_noise_from_smooth_images():
    torch.manual_seed(0)
    judge = PatchGan(4)
    optimiser = torch.optim.Adam(judge.parameters(), 1e-3)
    condition = torch.zeros(2, 1, 32, 32)
    smooth = torch.nn.functional.interpolate(image(0, (2, 2)), (32, 32), mode="bilinear")
    noise = image(1, (32, 32))
    for _ in range(12):
        loss = judging(judge(condition, smooth), judge(condition, noise))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    assert float(loss.detach()) < 0.2 < math.log(2)
