"""The generator of residual blocks: its published size, and any size of image."""

from __future__ import annotations

import pytest
import torch

from gibench.baselines.resnet_generator.network import ResidualBlock, ResidualGenerator


def test_its_size_is_the_published_one():
    with torch.device("meta"):
        network = ResidualGenerator(3)
    assert round(sum(one.numel() for one in network.parameters()) / 1e6, 2) == 11.38


@torch.no_grad()
@pytest.mark.parametrize("size", [(1, 1), (5, 40), (8, 8), (13, 22)])
def test_any_size(size):
    torch.manual_seed(0)
    network = ResidualGenerator(4, 3).eval()
    found = network(torch.randn(1, 4, *size))
    assert found.shape == (1, 3, *size)
    assert torch.isfinite(found).all()


@torch.no_grad()
def test_a_block_adds_to_what_it_is_given():
    torch.manual_seed(0)
    block = ResidualBlock(6)
    features = torch.randn(2, 6, 9, 9)
    torch.testing.assert_close(block(features) - features, block.layers(features))
    torch.nn.init.zeros_(block.layers[5].weight)
    torch.testing.assert_close(block(features), features, atol=1e-2, rtol=0)
