"""The network of Neural Global Illumination: its published size, its parts, any size of image."""

from __future__ import annotations

import dataclasses

import pytest
import torch

from gibench.baselines.neural_global_illumination.network import (
    FACING,
    FULL,
    INPUTS,
    SMALL,
    NeuralGlobalIllumination,
    Size,
)
from gibench.baselines.training.codes import LogCode

TINY = Size((8, 8, 8), 4, 16, 6, 3, ("position", "view"))


def network(size=TINY, seed=0):
    torch.manual_seed(seed)
    return NeuralGlobalIllumination(size).eval()


def parameters(size):
    with torch.device("meta"):
        return sum(one.numel() for one in NeuralGlobalIllumination(size).parameters())


def test_sizes_are_those_of_the_paper():
    count = parameters(FULL)
    assert round(count / 1e6, 2) == 14.65
    assert round(4 * count / 2**20, 1) == 55.9
    assert sum(INPUTS.values()) == 34
    with torch.device("meta"):
        assert NeuralGlobalIllumination(FULL).hidden[0].in_features == 842
        assert NeuralGlobalIllumination(FULL).hidden[4].in_features == 256 + 842
    assert parameters(SMALL) < 1.3e6


@torch.no_grad()
@pytest.mark.parametrize("size", [(1, 1), (8, 8), (13, 22), (40, 16)])
def test_any_size(size):
    found = network()(torch.randn(2, 34, *size))
    assert found.shape == (2, 3, *size)
    assert torch.isfinite(found).all()


@torch.no_grad()
def test_without_the_screen_a_pixel_sees_itself_alone():
    net = network(dataclasses.replace(TINY, levels=()))
    pixels = torch.randn(1, 34, 8, 8)
    other = pixels.clone()
    other[..., 0, 0] += 1
    changed = (net(other) != net(pixels)).any(dim=1)[0]
    assert changed[0, 0]
    assert changed.sum() == 1
    with_screen = network()
    assert (with_screen(other) != with_screen(pixels)).any(dim=1).sum() > 32


@torch.no_grad()
def test_only_what_is_named_is_encoded():
    assert parameters(dataclasses.replace(TINY, frequencies=0)) < parameters(TINY)
    net = network()
    assert net.encoded.tolist() == [0, 1, 2, 13, 14, 15]
    wider = network(dataclasses.replace(TINY, encoded=tuple(INPUTS)))
    assert len(wider.encoded) == 34
    assert network(dataclasses.replace(TINY, frequencies=0))(torch.randn(1, 34, 8, 8)).shape == (1, 3, 8, 8)


def test_fewer_inputs_are_those_at_the_beginning():
    net = NeuralGlobalIllumination(dataclasses.replace(TINY, encoded=tuple(INPUTS)), inputs=19)
    assert net.encoded.tolist() == list(range(19))
    assert net(torch.randn(1, 19, 8, 8)).shape == (1, 3, 8, 8)


def test_inputs_beyond_those_of_the_paper_are_not_encoded():
    more, paper = NeuralGlobalIllumination(TINY, 34 + FACING), NeuralGlobalIllumination(TINY)
    assert torch.equal(more.encoded, paper.encoded)
    assert more(torch.randn(1, 37, 8, 8)).shape == (1, 3, 8, 8)


def test_every_parameter_learns_through_the_code():
    net = network().train()
    code = LogCode(100.0)
    code.decode(0.1 * net(torch.randn(2, 34, 16, 16))).mean().backward()
    for name, parameter in net.named_parameters():
        assert torch.isfinite(parameter.grad).all(), name
        assert parameter.grad.abs().sum() > 0, name


def test_it_learns_an_image_from_its_positions():
    torch.manual_seed(0)
    net = NeuralGlobalIllumination(TINY)
    ticks = torch.linspace(-1, 1, 16)
    pixels = torch.zeros(1, 34, 16, 16)
    pixels[0, 0], pixels[0, 1] = torch.meshgrid(ticks, ticks, indexing="ij")
    truth = torch.sin(4 * pixels[:, :1]) * torch.cos(3 * pixels[:, 1:2])
    optimiser = torch.optim.Adam(net.parameters(), 5e-3)
    for _ in range(80):
        loss = (net(pixels) - truth).abs().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    assert float(loss.detach()) < 0.2 * float(truth.abs().mean())
