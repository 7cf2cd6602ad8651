"""The folded network against the equations of the paper, and that light stays linear in it."""

from __future__ import annotations

import pytest
import torch
from torch.utils._python_dispatch import TorchDispatchMode

from gibench.baselines.neural_free_viewpoint_relighting import network as network_of
from gibench.baselines.neural_free_viewpoint_relighting.inputs import coded
from gibench.baselines.neural_free_viewpoint_relighting.network import (
    FULL,
    SMALL,
    HashField,
    TransportNetwork,
)


def network(size=SMALL, faces=16, table=10, *, encoding=True, seed=0):
    torch.manual_seed(seed)
    made = TransportNetwork(HashField(size, table), size, faces, encoding=encoding)
    with torch.no_grad():
        made.field.grid.entries.normal_()  # as if it had learned something
    return made.eval()


def pixels(count, seed=1):
    generator = torch.Generator().manual_seed(seed)
    material = torch.rand(count, 13, generator=generator)
    material[:, :6] = 2 * material[:, :6] - 1
    material[:, 3:6] = torch.nn.functional.normalize(material[:, 3:6], dim=1)
    return torch.rand(count, 3, generator=generator), material


def light(count, faces=16, seed=2):
    generator = torch.Generator().manual_seed(seed)
    places = torch.randperm(6 * faces**2, generator=generator)[:count]
    return places, torch.randn(count, 3, generator=generator)


def plain(net, points, material, places, weights):
    """Equations 3, 4 and 7, one pixel and one wavelet at a time, in double precision."""
    # Of the finest of 32 levels, single precision knows a place to half a percent of a cell.
    features = net.field(points).double()
    net = net.double()
    given = coded(material.double(), net.degree)
    product = features[:, None] * net.wavelets[places][None]
    mixed = net.mixing(product)
    joined = torch.cat([mixed, given[:, None].expand(-1, len(places), -1)], dim=-1)
    transport = net.last(net.second(net.first(joined).relu()).relu())
    net.float()
    return (transport * weights.double()).sum(dim=1)


@pytest.mark.parametrize(("size", "encoding"), [(SMALL, True), (SMALL, False), (FULL, True)])
def test_folded_is_the_plain_form(size, encoding):
    net = network(size, encoding=encoding)
    given = (*pixels(50), *light(24))
    with torch.no_grad():
        expected = plain(net, *given).float()
        scale = expected.abs().max()
        for found in (net(*given), net.frame(*given)):
            assert (found - expected).abs().max() <= 1e-5 * scale


def test_a_batch_is_what_its_parts_are():
    net = network()
    parts = [(*pixels(7, seed), *light(5, seed=seed)) for seed in (1, 2)]
    with torch.no_grad():
        together = net(*(torch.stack(both) for both in zip(*parts, strict=True)))
        for one, found in zip(parts, together, strict=True):
            torch.testing.assert_close(net(*one), found, rtol=1e-5, atol=1e-5)


def test_light_is_linear():
    """Twice the environment gives twice the light, two environments in the same wavelets their sum."""
    net = network()
    points, material = pixels(40)
    places, one = light(30)
    other = light(30, seed=5)[1]
    a, b, both, twice = (
        net.frame(points, material, places, weights) for weights in (one, other, one + other, 2 * one)
    )
    scale = both.abs().max()
    assert (twice - 2 * a).abs().max() <= 1e-6 * scale
    assert (a + b - both).abs().max() <= 1e-5 * scale
    # The order of the wavelets says nothing, and one without light adds nothing.
    order = torch.randperm(30)
    assert (net.frame(points, material, places[order], one[order]) - a).abs().max() <= 1e-5 * scale
    dark = torch.cat([one, torch.zeros(1, 3)])
    more = net.frame(points, material, torch.cat([places, torch.tensor([int(places.max()) - 1])]), dark)
    assert (more - a).abs().max() <= 1e-5 * scale


def test_without_light_it_is_black():
    net = network()
    points, material = pixels(10)
    nothing = torch.zeros(0, dtype=torch.long), torch.zeros(0, 3)
    assert not net.frame(points, material, *nothing).any()
    places, weights = light(8)
    assert not net.frame(points, material, places, 0 * weights).any()
    assert net.frame(torch.zeros(0, 3), torch.zeros(0, 13), places, weights).shape == (0, 3)


def test_huge_light_and_hard_surfaces_are_finite():
    net = network()
    points, material = pixels(64)
    material[:32, 6] = 0.005  # roughness
    material[32:, 6] = 0.0
    material[:16, 7:] = 0.0  # nothing is reflected
    material[16:32, 10:] = 1.0
    points[0], points[1] = torch.tensor([-5.0, 0.5, 9.0]), torch.ones(3)
    places, weights = light(64)
    found = net.frame(points, material, places, 1e7 * weights)
    assert found.isfinite().all()


def test_bfloat16_is_off_by_its_digits():
    """Numbers have 8 of them and are off by 2⁻⁹ at most; a sum of signed ones by a few times as much."""
    net = network()
    points, material = pixels(300)
    places, weights = light(64)
    exact, rough = (
        net.frame(points, material, places, weights, precision=precision)
        for precision in (torch.float32, torch.bfloat16)
    )
    assert rough.dtype == torch.float32
    away = (rough - exact).abs().mean() / exact.abs().mean()
    assert 1e-4 < away < 0.02
    assert not net.frame(points, material, places, 0 * weights, precision=torch.bfloat16).any()
    huge = net.frame(points, material, places, 1e7 * weights, precision=torch.bfloat16)
    torch.testing.assert_close(huge / 1e7, rough, rtol=0.05, atol=0.02 * float(exact.abs().max()))


class Largest(TorchDispatchMode):
    """The number of elements of the largest tensor that is made."""

    def __init__(self):
        super().__init__()
        self.largest = 0

    def __torch_dispatch__(self, function, types, args=(), kwargs=None):
        found = function(*args, **(kwargs or {}))
        for one in found if isinstance(found, tuple | list) else (found,):
            if isinstance(one, torch.Tensor) and one.untyped_storage().nbytes():
                self.largest = max(self.largest, one.numel())
        return found


@pytest.mark.parametrize("wavelets", [16, 256])
def test_memory_does_not_grow_with_the_resolution(monkeypatch, wavelets):
    monkeypatch.setattr(network_of, "FIELD_PIXELS", 64)
    monkeypatch.setattr(network_of, "LARGEST", 1 << 15)
    net = network()
    places, weights = light(wavelets)
    made = []
    for count in (200, 1000):
        points, material = pixels(count)
        with Largest() as watch:
            net.frame(points, material, places, weights)
        made.append(watch.largest)
    of_wavelets = wavelets * SMALL.products * SMALL.hidden
    # Corners of all levels of the pixels that are looked up at once, the matrices of the wavelets, or the result.
    assert made[0] <= max(of_wavelets, 64 * SMALL.levels * 8 * 2)
    assert made[1] <= max(made[0], 3 * 1000)


def test_sizes_are_the_published_ones():
    """Section 5: 6.1 MB of wavelets, 36 KB and 124 KB of matrices, which pad 93 inputs to 96 and 3 outputs to 16."""
    with torch.device("meta"):
        net = TransportNetwork(torch.nn.Identity(), FULL, 64)
    assert net.wavelets.shape == (24_576, 64)
    assert 4 * net.wavelets.numel() == pytest.approx(6.1e6, rel=0.04)
    assert net.mixing.weight.shape == (64, 64)
    assert (net.first.in_features, net.second.in_features) == (64 + 13 + 16, 128)
    assert pytest.approx(124e3, rel=0.02) == 4 * (96 * 128 + 128 * 128 + 128 * 16)


def test_everything_learns():
    net = network().train()
    found = net(*pixels(16), *light(12))
    found.square().sum().backward()
    for name, parameter in net.named_parameters():
        assert parameter.grad is not None, name
        assert parameter.grad.any(), name
