"""Bilateral convolutions: a convolution on a wall, none across an edge, and the size of the network."""

from __future__ import annotations

import pytest
import torch

from gibench.baselines.bilateral_network.network import (
    BilateralConvolution,
    BilateralNetwork,
    Surfaces,
)

SMALL = (8, 8, 16)


def wall(height=6, width=8, count=1):
    """A wall that faces the camera, so far away that its pixels are one place."""
    geometry = torch.zeros(count, 7, height, width)
    geometry[:, 2] = geometry[:, 6] = 1e6
    geometry[:, 5] = -1
    return geometry


def layer(inputs=3, outputs=4):
    torch.manual_seed(0)
    return BilateralConvolution(inputs, outputs)


def test_its_size_is_the_published_one():
    with torch.device("meta"):
        assert round(sum(one.numel() for one in BilateralNetwork().parameters()) / 1e6, 2) == 3.95


@torch.no_grad()
def test_on_a_wall_it_is_a_convolution():
    features = torch.randn(1, 3, 6, 8)
    bilateral = layer()
    found = bilateral(features, Surfaces(wall()))
    torch.testing.assert_close(found, bilateral.convolution(features), rtol=1e-4, atol=1e-5)


@torch.no_grad()
@pytest.mark.parametrize("channel", [3, 0])
def test_nothing_comes_across_an_edge(channel):
    """Of directions and of places."""
    geometry = wall()
    geometry[:, channel, :, 4:] += 1e9
    bilateral = layer()
    features = torch.randn(1, 3, 6, 8)
    other = features.clone()
    other[..., 4:] += 1
    first, second = (bilateral(one, Surfaces(geometry)) for one in (features, other))
    assert torch.equal(first[..., :4], second[..., :4])
    assert not torch.equal(first[..., 4:], second[..., 4:])


@torch.no_grad()
def test_it_is_the_formula():
    """In loops over pixels and taps, of weights that are not all alike."""
    bilateral = layer()
    geometry = torch.randn(1, 7, 4, 5)
    geometry[:, 6] = geometry[:, 6].abs() + 1
    features = torch.randn(1, 3, 4, 5)
    found = bilateral(features, Surfaces(geometry))[0]
    position, normal, depth = geometry[0].split((3, 3, 1))
    kernel, bias = bilateral.convolution.weight, bilateral.convolution.bias
    for y in range(4):
        for x in range(5):
            weights, terms = [], []
            for row in (-1, 0, 1):
                for column in (-1, 0, 1):
                    v, u = min(max(y + row, 0), 3), min(max(x + column, 0), 4)
                    apart = (normal[:, y, x] - normal[:, v, u]).square().sum()
                    way = (position[:, y, x] - position[:, v, u]).square().sum() / depth[0, y, x] ** 2
                    weights.append(torch.exp(-apart - way))
                    inside = (v, u) == (y + row, x + column)
                    value = features[0, :, v, u] if inside else torch.zeros(3)
                    terms.append(weights[-1] * kernel[:, :, row + 1, column + 1] @ value)
            expected = sum(terms) / torch.stack(weights).mean() + bias
            torch.testing.assert_close(found[:, y, x], expected, rtol=1e-4, atol=1e-4)


def test_every_parameter_learns():
    network = BilateralNetwork(SMALL).train()
    network(torch.rand(1, 2, 3, 12, 16), torch.randn(1, 7, 12, 16)).square().mean().backward()
    for name, parameter in network.named_parameters():
        assert torch.isfinite(parameter.grad).all(), name
        assert parameter.grad.abs().sum() > 0, name
