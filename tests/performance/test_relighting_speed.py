"""What a frame of `nfvr` costs: the folded network against the plain form, and against the number of wavelets."""

from __future__ import annotations

from functools import partial

import pytest
import torch

from gibench.baselines.neural_free_viewpoint_relighting.inputs import coded
from gibench.baselines.neural_free_viewpoint_relighting.network import (
    FULL,
    SMALL,
    HashField,
    TransportNetwork,
)
from tests.performance.turns import seconds

pytestmark = pytest.mark.performance

PIXELS = 128 * 128

MOST_SECONDS = 0.6
"""Of a frame of 128 × 128 from 64 wavelets by the small network, on two cores."""

AT_ONCE = 512
"""Pixels of the plain form, which has a row for each pixel and wavelet."""


def made(size, table):
    torch.manual_seed(0)
    network = TransportNetwork(HashField(size, table), size, 32).eval()
    material = torch.rand(PIXELS, 13)
    material[:, 3:6] = torch.nn.functional.normalize(material[:, 3:6], dim=1)
    return network, torch.rand(PIXELS, 3), material


@torch.inference_mode()
def plain(network, points, material, places, light):
    radiance = []
    for some in torch.arange(PIXELS).split(AT_ONCE):
        features, given = network.field(points[some]), coded(material[some], network.degree)
        mixed = network.mixing(features[:, None] * network.wavelets[places])
        joined = torch.cat([mixed, given[:, None].expand(-1, len(places), -1)], dim=-1)
        transport = network.last(network.second(network.first(joined).relu()).relu())
        radiance.append((transport * light).sum(dim=1))
    return torch.cat(radiance)


@pytest.mark.parametrize(("name", "size", "table"), [("small", SMALL, 15), ("full", FULL, 19)])
def test_a_frame(name, size, table):
    network, points, material = made(size, table)
    lights = {count: (torch.arange(count), torch.randn(count, 3)) for count in (16, 64, 256)}
    frames = [partial(network.frame, points, material, *light) for light in lights.values()]
    *folded, unfolded = seconds(*frames, partial(plain, network, points, material, *lights[64]), repeats=3)
    times = dict(zip(lights, folded, strict=True))
    told = ", ".join(f"{count} wavelets {1e3 * time:.0f} ms" for count, time in times.items())
    print(
        f"\n{name}, 128 × 128: {told}; the plain form takes {unfolded / times[64]:.2f} times as long with 64"
    )
    assert times[64] < unfolded
    if name == "small":
        assert times[64] <= MOST_SECONDS
