"""What a frame of `nfvr` costs: the folded network against the plain form, and against the number of wavelets."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import torch

from gibench.baselines.neural_free_viewpoint_relighting.draws import Draw, Important
from gibench.baselines.neural_free_viewpoint_relighting.inputs import coded
from gibench.baselines.neural_free_viewpoint_relighting.network import (
    FULL,
    SMALL,
    HashField,
    TransportNetwork,
)
from gibench.baselines.relighting.examples import Seen
from gibench.baselines.wavelets.haar import haar
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
    frames.append(partial(network.frame, points, material, *lights[64], precision=torch.bfloat16))
    *folded, rough, unfolded = seconds(
        *frames, partial(plain, network, points, material, *lights[64]), repeats=3
    )
    times = dict(zip(lights, folded, strict=True))
    told = ", ".join(f"{count} wavelets {1e3 * time:.0f} ms" for count, time in times.items())
    print(
        f"\n{name}, 128 × 128: {told}; with 64 the plain form takes {unfolded / times[64]:.2f} times as long, bfloat16 "
        f"{rough / times[64]:.2f}"
    )
    assert times[64] < unfolded
    if name == "small":
        assert times[64] <= MOST_SECONDS


class OneFrame:
    """A frame of PIXELS, under noise on faces of 32 × 32."""

    def __init__(self):
        generator = torch.Generator().manual_seed(0)
        widths = (3, 13, 3)
        points, *halves = (torch.rand(PIXELS, width, generator=generator) for width in widths)
        detail = torch.rand(PIXELS, generator=generator)
        self.frame = Seen(points, *(part.half() for part in (*halves, detail)))
        self.light = haar(np.random.default_rng(0).gamma(0.5, size=(6, 32, 32, 3)))

    def __len__(self):
        return 1

    def __getitem__(self, index):
        return self.frame, self.light

    def seen(self, index):
        return self.frame


def test_what_a_step_draws():
    """Chances are summed up once a frame: after that a draw by them costs about as much as one of any pixels."""
    draw, random, plain = Draw(512, 96), np.random.default_rng(0), OneFrame()
    examples = Important(plain)
    first, later, uniform = seconds(
        lambda: draw((plain.frame, plain.light, examples._sums(plain.frame)), random),
        lambda: draw(examples[0], random),
        lambda: draw(plain[0], random),
        repeats=9,
    )
    print(
        f"\na draw of 512 pixels and 96 wavelets: {1e3 * later:.1f} ms, {first / later:.1f} times as long the first "
        f"time, {uniform / later:.2f} times as long of any pixels"
    )
    assert later < 0.8 * first
