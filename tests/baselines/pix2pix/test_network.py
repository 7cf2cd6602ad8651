"""The U-Net of pix2pix: its published size, any size of image, and what it forgets while training."""

from __future__ import annotations

import pytest
import torch
from torch.nn.functional import leaky_relu, relu

from gibench.baselines.pix2pix.network import SLOPE, UNet


def parameters(*given, **more):
    with torch.device("meta"):
        return sum(one.numel() for one in UNet(*given, **more).parameters())


@pytest.mark.parametrize("inputs", [3, 6])
def test_its_size_is_the_published_one(inputs):
    assert round(parameters(inputs) / 1e6, 2) == 41.83


@torch.no_grad()
@pytest.mark.parametrize("size", [(1, 1), (32, 32), (33, 70), (64, 96), (63, 32), (200, 133)])
def test_any_size(size):
    torch.manual_seed(0)
    network = UNet(5, 2, (8, 8, 16, 16, 16)).eval()
    assert network.smallest == 32
    image = torch.randn(2, 5, *size)
    found = network(image)
    assert found.shape == (2, 2, *size)
    assert torch.isfinite(found).all()
    torch.testing.assert_close(network(image[:1]), found[:1], rtol=1e-4, atol=1e-5)


@torch.no_grad()
@pytest.mark.parametrize("size", [(1, 1), (8, 8), (32, 32), (64, 96), (32, 5)])
def test_sides_that_can_be_halved_are_padded_to_the_shortest_one_alone(size):
    """And what they are padded with is the last row and column."""
    torch.manual_seed(0)
    network = UNet(5, 2, (8, 8, 16, 16, 16)).eval()
    image = torch.randn(1, 5, *size)
    rows, columns = (torch.arange(max(32, side)).clamp(max=side - 1) for side in size)
    whole = image[:, :, rows][..., columns]
    skips, features = [], whole
    for level, down in enumerate(network.down):
        features = down(leaky_relu(features, SLOPE) if level else features)
        if 0 < level < 4:
            features = network.down_norms[level - 1](features)
        skips.append(features)
    features = skips.pop()
    for level, up in enumerate(network.up):
        features = up(relu(features))
        if skips:
            features = torch.cat([network.up_norms[level](features), skips.pop()], dim=1)
    assert torch.equal(network(image), features[..., : size[0], : size[1]])


@torch.no_grad()
def test_what_is_larger_is_not_padded():
    """A frame of 192 × 128 has three quarters of the pixels of the next multiple of 128."""
    torch.manual_seed(0)
    network = UNet(5, 2, (8,) * 7).eval()
    sizes = []
    network.down[0].register_forward_pre_hook(lambda layer, given: sizes.append(tuple(given[0].shape[-2:])))
    image = torch.randn(1, 5, 128, 192)
    found = network(image)
    assert found.shape == (1, 2, 128, 192)
    other = image.clone()
    other[..., 0, 0] += 10
    assert (network(other)[..., -1, -1] != found[..., -1, -1]).all()
    for size in ((131, 201), (128, 255), (200, 133)):
        found = network(torch.randn(1, 5, *size))
        assert found.shape == (1, 2, *size)
        assert found.isfinite().all()
    assert sizes == [(128, 192), (128, 192), (131, 201), (128, 255), (200, 133)]


def test_the_first_weights_are_small_and_all_of_them_learn():
    torch.manual_seed(0)
    network = UNet(5, 2, (8, 8, 16, 16, 16))
    assert float(network.down[2].weight.detach().std()) == pytest.approx(0.02, rel=0.1)
    network(torch.randn(2, 5, 64, 64)).square().mean().backward()
    assert all(parameter.grad.abs().sum() > 0 for parameter in network.parameters())


def test_dropping_is_for_training_and_can_be_left_out():
    torch.manual_seed(0)
    image = torch.randn(1, 5, 32, 32)
    for dropped in (3, 0):
        network = UNet(5, 2, (8, 8, 16, 16, 16), dropped=dropped)
        assert torch.equal(network(image), network(image)) == (dropped == 0)
        network.eval()
        assert torch.equal(network(image), network(image))


@torch.no_grad()
def test_everything_is_seen_from_everywhere():
    torch.manual_seed(0)
    network = UNet(1, 1, (8, 8, 16, 16, 16)).eval()
    image = torch.randn(1, 1, 32, 32)
    other = image.clone()
    other[..., 0, 0] += 10
    assert network(other)[..., -1, -1] != network(image)[..., -1, -1]
