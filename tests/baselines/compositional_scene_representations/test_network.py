"""The networks of `cnnr`: their sizes, and what depends on what."""

from __future__ import annotations

import pytest
import torch

from gibench.baselines.compositional_scene_representations.network import (
    FULL,
    OBSERVATIONS,
    PIXEL,
    SIDE,
    SMALL,
    Encoder,
    Represented,
    Size,
)

TINY = Size(16, 16)


def count(module):
    return sum(one.numel() for one in module.parameters())


def test_sizes():
    """The encoder has the 2.00 M parameters of the authors' own."""
    with torch.device("meta"):
        assert count(Encoder(FULL)) == 2_000_640
        assert round(count(Represented(FULL)) / 1e6, 2) == 5.76
        assert round(count(Represented(SMALL)) / 1e6, 2) == 0.39


@torch.no_grad()
def test_all_pixels_share_what_the_observations_say():
    torch.manual_seed(0)
    network = Represented(TINY, torch.rand(OBSERVATIONS, 7, SIDE, SIDE), torch.rand(OBSERVATIONS, 16))
    light, pixels = torch.rand(2, OBSERVATIONS, 3, SIDE, SIDE), torch.rand(2, PIXEL, 7, 9)
    found = network(light, pixels)
    assert found.shape == (2, 3, 7, 9)
    other = pixels.clone()
    other[..., 3, 4] += 1
    changed = (network(light, other) != found).any(dim=1)
    assert changed[:, 3, 4].all()
    assert changed.sum() == 2
    brighter = light.clone()
    brighter[0, 1] += 1
    changed = (network(brighter, pixels) != found).any(dim=1)
    assert changed[0].all()
    assert not changed[1].any()


@torch.no_grad()
def test_the_order_of_observations_does_not_matter():
    torch.manual_seed(0)
    fixed, poses = torch.rand(OBSERVATIONS, 7, SIDE, SIDE), torch.rand(OBSERVATIONS, 16)
    first, again = Represented(TINY, fixed, poses), Represented(TINY, fixed.flip(0), poses.flip(0))
    again.load_state_dict({**first.state_dict(), "fixed": fixed.flip(0), "poses": poses.flip(0)})
    light = torch.rand(1, OBSERVATIONS, 3, SIDE, SIDE)
    torch.testing.assert_close(first.represented(light), again.represented(light.flip(1)))


@torch.no_grad()
@pytest.mark.parametrize("size", [(1, 1), (320, 320)])
def test_any_size_of_frame(size):
    found = Represented(TINY)(torch.zeros(1, OBSERVATIONS, 3, SIDE, SIDE), torch.rand(1, PIXEL, *size))
    assert found.shape[-2:] == size
    assert found.isfinite().all()
