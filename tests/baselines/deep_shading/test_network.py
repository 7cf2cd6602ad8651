"""Deep Shading: its size, its three colours, any size of image."""

from __future__ import annotations

import pytest
import torch

from gibench.baselines.deep_shading.network import CHANNELS, DeepShading, OfEachColour


def test_its_size_is_within_a_quarter_percent_of_the_published_one():
    """Direct light and albedo of a colour, position, normal, depth. The paper has 7.75 M."""
    with torch.device("meta"):
        network = OfEachColour(2, 7)
    count = sum(one.numel() for one in network.parameters())
    assert count == pytest.approx(7.75e6, rel=2.5e-3)
    assert round(count / 3e6, 2) == 2.58


def test_channels_are_kept_on_the_way_up_and_halved_after_joining():
    with torch.device("meta"):
        network = DeepShading(9)
    for up, mix, count in zip(network.up, network.mix, CHANNELS[::-1], strict=True):
        assert (up.in_channels, up.out_channels) == (count, count)
        assert mix.in_channels == 2 * count
        assert mix.out_channels == (count // 2 if count > 8 else 1)


@torch.no_grad()
@pytest.mark.parametrize("size", [(1, 1), (64, 64), (65, 30)])
def test_any_size(size):
    torch.manual_seed(0)
    found = OfEachColour(2, 7).eval()(torch.randn(2, 2, 3, *size), torch.randn(2, 7, *size))
    assert found.shape == (2, 3, *size)
    assert torch.isfinite(found).all()


@torch.no_grad()
def test_no_network_sees_another_colour():
    torch.manual_seed(0)
    network = OfEachColour(2, 7).eval()
    light, geometry = torch.randn(1, 2, 3, 64, 64), torch.randn(1, 7, 64, 64)
    other = light.clone()
    other[:, :, 1] += 1
    before, after = network(light, geometry), network(other, geometry)
    assert torch.equal(before[:, [0, 2]], after[:, [0, 2]])
    assert not torch.equal(before[:, 1], after[:, 1])


def test_features_are_dropped_only_while_it_trains():
    torch.manual_seed(0)
    network = DeepShading(2)
    image = torch.randn(1, 2, 64, 64)
    assert not torch.equal(network(image), network(image))
    network.eval()
    assert torch.equal(network(image), network(image))
