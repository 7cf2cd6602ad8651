"""The U-Net of pix2pix: its published size, any size of image, and what it forgets while training."""

from __future__ import annotations

import pytest
import torch

from gibench.baselines.pix2pix.network import UNet


def parameters(*given, **more):
    with torch.device("meta"):
        return sum(one.numel() for one in UNet(*given, **more).parameters())


@pytest.mark.parametrize("inputs", [3, 6])
def test_its_size_is_the_published_one(inputs):
    assert round(parameters(inputs) / 1e6, 2) == 41.83


@torch.no_grad()
@pytest.mark.parametrize("size", [(1, 1), (32, 32), (33, 70), (64, 96)])
def test_any_size(size):
    torch.manual_seed(0)
    network = UNet(5, 2, (8, 8, 16, 16, 16)).eval()
    assert network.multiple == 32
    image = torch.randn(2, 5, *size)
    found = network(image)
    assert found.shape == (2, 2, *size)
    assert torch.isfinite(found).all()
    torch.testing.assert_close(network(image[:1]), found[:1], rtol=1e-4, atol=1e-5)


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
