"""The network: its published sizes, and what must hold for it whatever it has learned."""

from __future__ import annotations

import itertools

import pytest
import torch

from gibench.baselines.geometry_aware_feature_aggregation import network as network_module
from gibench.baselines.geometry_aware_feature_aggregation.network import (
    FULL,
    MINI,
    GeometryAware,
    Size,
)
from gibench.baselines.image_to_image.shading import (
    GEOMETRY,
    brightness,
    demodulated,
    indirect,
    remodulated,
)

SMALL = Size((8, 16, 16), (8, 8, 16), heads=2, query=4)


def parameters(size):
    with torch.device("meta"):
        return sum(one.numel() for one in GeometryAware(size).parameters())


def network(size=SMALL, seed=0):
    torch.manual_seed(seed)
    return GeometryAware(size).eval()


def view(height=24, width=32, seed=0, count=2):
    generator = torch.Generator().manual_seed(seed)
    direct, albedo = (torch.rand(count, 3, height, width, generator=generator) for _ in "ab")
    return direct, albedo, torch.randn(count, GEOMETRY, height, width, generator=generator)


def test_sizes_are_those_of_the_paper():
    assert round(parameters(FULL) / 1e6, 2) == 14.42
    assert round(parameters(MINI) / 1e6, 2) == 8.76
    fewer = Size(FULL.light, FULL.geometry, heads=7)
    assert round((parameters(FULL) - parameters(fewer)) / 1e6, 3) == 0.024


@torch.no_grad()
@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_colours_that_are_permuted_are_permuted_to_the_last_bit(order):
    direct, albedo, geometry = view()
    order = list(order)
    net = network()
    # One image for all three: what is done to a colour depends on nothing but that colour, but for the exposure.
    expected = indirect(net, direct, albedo, geometry)[:, order]
    torch.testing.assert_close(
        indirect(net, direct[:, order], albedo[:, order], geometry), expected, rtol=1e-5, atol=0
    )
    light = torch.stack([direct, albedo], dim=1)
    assert torch.equal(net(light[:, :, order], geometry), net(light, geometry)[:, order])


@torch.no_grad()
def test_all_colours_together_are_not():
    net = network(Size(SMALL.light, SMALL.geometry, 2, 4, colours=3))
    direct, albedo, geometry = view()
    light = torch.stack([direct, albedo], dim=1)
    assert net(light, geometry).shape == direct.shape
    assert not torch.allclose(net(light.flip(2), geometry), net(light, geometry).flip(1), rtol=1e-2)


@torch.no_grad()
@pytest.mark.parametrize("factor", [2.0**-13, 2.0**17, 1e-4, 3.7, 1e5])
def test_a_brighter_room_is_the_same_room(factor):
    """Exactly for powers of 2, else to single precision through an exponential."""
    direct, albedo, geometry = view()
    net = network()
    expected = factor * indirect(net, direct, albedo, geometry)
    found = indirect(net, factor * direct, albedo, geometry)
    exact = factor in (2.0**-13, 2.0**17)
    torch.testing.assert_close(found, expected, rtol=0 if exact else 2e-5, atol=0)


@torch.no_grad()
def test_rows_of_the_attention_add_up_to_1_and_come_from_geometry_alone():
    net = network()
    kept = []
    # What the aggregation is given, which asks for one block of rows after the other.
    net.aggregation.register_forward_pre_hook(
        lambda module, given: kept.append(list(given[1])) or (given[0], kept[-1])
    )
    direct, albedo, geometry = view()
    for light in (direct, 0 * direct):
        indirect(net, light, albedo, geometry)
    (first,), (second,) = kept
    assert first.shape == (2, 2, 48, 48)
    torch.testing.assert_close(first.sum(-1), torch.ones(2, 2, 48))
    assert (first >= 0).all()
    assert torch.equal(first, second)


@torch.no_grad()
def test_the_attention_is_the_formula():
    """Equation 3 and 4 in loops over places and heads."""
    net = network()
    geometry = torch.randn(1, 16, 3, 4)
    inputs, light = torch.randn(1, GEOMETRY, 3, 4), torch.randn(1, 2, 16, 3, 4)
    (attention,) = net.attention(geometry, inputs)
    found = net.aggregation(light, [attention])
    both = torch.cat([geometry, inputs], 1)[0].flatten(1)
    query, key = (
        part.weight[:, :, 0, 0] @ both + part.bias[:, None]
        for part in (net.attention.queries, net.attention.keys)
    )
    values = net.aggregation.values
    for colour in range(2):
        x = light[0, colour].flatten(1)
        v = values.weight[:, :, 0, 0] @ x + values.bias[:, None]
        for i in range(12):
            parts = []
            for head in range(2):
                scores = torch.stack(
                    [query[4 * head : 4 * head + 4, i] @ key[4 * head : 4 * head + 4, j] for j in range(12)]
                )
                weights = (scores / 2).exp() / (scores / 2).exp().sum()
                torch.testing.assert_close(attention[0, head, i], weights)
                parts.append(v[8 * head : 8 * head + 8] @ weights)
            torch.testing.assert_close(
                found[0, colour].flatten(1)[:, i], x[:, i] + torch.cat(parts), atol=1e-5, rtol=1e-5
            )


@torch.no_grad()
def test_an_attention_in_blocks_is_the_attention(monkeypatch):
    net = network()
    direct, albedo, geometry = view()
    expected = indirect(net, direct, albedo, geometry)
    monkeypatch.setattr(network_module, "LARGEST", 2 * 2 * 48 * 7)
    features, inputs = torch.randn(2, 16, 6, 8), torch.randn(2, GEOMETRY, 6, 8)
    assert [len(rows[0, 0]) for rows in net.attention(features, inputs)] == [7] * 6 + [6]
    torch.testing.assert_close(indirect(net, direct, albedo, geometry), expected, rtol=1e-4, atol=0)


@torch.no_grad()
def test_a_distant_wall_reaches_everywhere():
    """Further than any convolution of the network does, and only through the attention."""
    net = network(Size((8, 8), (8, 8), heads=2, query=4))
    direct, albedo, geometry = view(8, 256, count=1)
    light = torch.stack([direct, albedo], dim=1)
    other = light.clone()
    other[..., :8] += 1
    far = (slice(None), slice(None), slice(None), slice(200, None))
    assert (net(other, geometry)[far] != net(light, geometry)[far]).any()
    net.aggregation.values.weight.zero_()
    assert torch.equal(net(other, geometry)[far], net(light, geometry)[far])


@torch.no_grad()
@pytest.mark.parametrize("size", [(1, 1), (8, 8), (7, 13), (24, 33), (64, 65)])
def test_any_size_is_padded_and_cut_again(size):
    direct, albedo, geometry = view(*size)
    for net in (network(), network(Size((8,) * 5, (8,) * 5, heads=2, query=4))):
        found = indirect(net, direct, albedo, geometry)
        assert found.shape == direct.shape
        assert torch.isfinite(found).all()


@torch.no_grad()
def test_what_fits_is_not_padded():
    net = network()
    assert net.multiple == 4
    direct, albedo, geometry = view(24, 32)
    rows = [part[..., :23, :] for part in (direct, albedo, geometry)]
    padded = [torch.cat([part, part[..., -1:, :]], dim=-2) for part in rows]
    light = [torch.stack(one[:2], dim=1) for one in (rows, padded)]
    torch.testing.assert_close(net(light[0], rows[2]), net(light[1], padded[2])[..., :23, :])


@torch.no_grad()
@pytest.mark.parametrize("direct", [0.0, 1e-4, 1e5, 1e30])
@pytest.mark.parametrize("albedo", [0.0, 0.5, 1.0])
def test_hard_frames_stay_finite(direct, albedo):
    _, _, geometry = view()
    light = torch.full((2, 3, 24, 32), direct)
    found = indirect(network(), light, torch.full_like(light, albedo), 100 * geometry)
    assert torch.isfinite(found).all()
    assert (found >= 0).all()


@torch.no_grad()
def test_a_single_bright_pixel_stays_finite():
    direct, albedo, geometry = view()
    direct[0, :, 5, 5] = 1e8
    found = indirect(network(), direct, albedo, geometry)
    assert torch.isfinite(found).all()


def test_demodulation_is_undone_and_black_surfaces_do_not_divide():
    radiance = torch.tensor([0.0, 1e-4, 1.0, 1e5])
    for albedo in (0.0, 1e-6, 0.5, 1.0):
        light = demodulated(radiance, torch.full_like(radiance, albedo))
        assert torch.isfinite(light).all()
        torch.testing.assert_close(remodulated(light, torch.full_like(radiance, albedo)), radiance)
    assert (brightness(torch.zeros(1, 3, 4, 4), torch.zeros(1, 3, 4, 4)) == 0).all()


def test_features_are_dropped_only_while_it_trains():
    net = network()
    direct, albedo, geometry = view()
    light = torch.stack([direct, albedo], dim=1)
    assert torch.equal(net(light, geometry), net(light, geometry))
    net.train()
    assert not torch.equal(net(light, geometry), net(light, geometry))


def test_every_parameter_learns():
    net = network().train()
    direct, albedo, geometry = view()
    indirect(net, direct, albedo, geometry).mean().backward()
    for name, parameter in net.named_parameters():
        assert torch.isfinite(parameter.grad).all(), name
        assert parameter.grad.abs().sum() > 0 or name == "attention.keys.bias", name
