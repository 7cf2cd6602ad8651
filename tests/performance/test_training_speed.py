"""What the shared loop adds to a step, whether bfloat16 pays, and how a hash grid is read."""

from __future__ import annotations

import importlib
from functools import partial

import pytest
import torch

from gibench.baselines.compositional_scene_representations import network as cnnr
from gibench.baselines.compositional_scene_representations.network import Represented
from gibench.baselines.efficient_light_probes.network import GUIDES, ReconstructionNetwork
from gibench.baselines.image_to_image.shading import GEOMETRY, LIGHT
from gibench.baselines.neural_free_viewpoint_relighting import network as nfvr
from gibench.baselines.neural_free_viewpoint_relighting.network import HashField, TransportNetwork
from gibench.baselines.neural_global_illumination.network import SMALL, NeuralGlobalIllumination
from gibench.baselines.neural_precomputed_radiance_transfer.network import LightEncoder
from gibench.baselines.training.budget import Budget
from gibench.baselines.training.encodings import hash_grid
from gibench.baselines.training.encodings.hash_grid import HashGrid
from gibench.baselines.training.loop import train
from gibench.baselines.training.reproducible import deterministic
from tests.baselines.training.toys import Fit, points
from tests.performance.turns import seconds

pytestmark = pytest.mark.performance


def test_what_the_loop_adds_to_a_step():
    """Beside the same steps without looks, seeds, clocks and checkpoints. The network is a toy: it is all overhead."""
    steps = 200
    ready = [batch for batch, _ in zip(points()(0), range(steps), strict=False)]

    def bare():
        network = Fit().networks["fit"]
        optimiser = torch.optim.Adam(network.parameters())
        for x, y in ready:
            optimiser.zero_grad(set_to_none=True)
            loss = (network(x) - y).square().mean()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimiser.step()

    def ours():
        train(Fit(), lambda first: iter(ready[first:]), Budget(steps=steps, look_every=steps), seed=0)

    plain, looped = seconds(bare, ours, repeats=5)
    print(
        f"\nthe loop adds {1e3 * (looped - plain) / steps:.2f} ms to a step of {1e3 * plain / steps:.2f} ms"
    )
    assert looped > 0


def of_images(package):
    """An image-to-image network at half of its channels, and what a step gives it."""
    method = importlib.import_module(f"gibench.baselines.{package}").METHOD
    module, name = method.implementation.split(":")
    settings = {knob.name: knob.default for knob in method.knobs} | {"width": 0.5}
    implementation = getattr(importlib.import_module(module), name)(settings)
    return implementation.network(), (torch.rand(2, LIGHT, 3, 128, 128), torch.randn(2, GEOMETRY, 128, 128))


def wavelets():
    """A step of the `cpu` preset: 4 frames, each with 96 of the wavelets of a cubemap of 32² a face."""
    count = 6 * 32**2
    places = torch.stack([torch.randperm(count)[:96] for _ in range(4)])
    given = torch.rand(4, 128, 3), torch.rand(4, 128, 13), places, torch.rand(4, 96, 3)
    return TransportNetwork(HashField(nfvr.SMALL, 15), nfvr.SMALL, 32), given


NETWORKS = {
    "ngi, small": lambda: (NeuralGlobalIllumination(SMALL), (torch.randn(2, 34, 64, 64),)),
    "cnnr, small": lambda: (
        Represented(cnnr.SMALL),
        (torch.rand(2, cnnr.OBSERVATIONS, 3, cnnr.SIDE, cnnr.SIDE), torch.rand(2, cnnr.PIXEL, 64, 64)),
    ),
    "gfa": lambda: of_images("geometry_aware_feature_aggregation"),
    "deep-shading": lambda: of_images("deep_shading"),
    "bcn": lambda: of_images("bilateral_network"),
    "pix2pix": lambda: of_images("pix2pix"),
    "resnet": lambda: of_images("resnet_generator"),
    "nfvr, small": wavelets,
    "the encoder of nprt": lambda: (LightEncoder(), (torch.rand(4, 3, 128, 256),)),
    "elp, 4 crops of 64²": lambda: (
        ReconstructionNetwork(),
        (torch.rand(4, 3, 64, 64), torch.rand(4, GUIDES, 64, 64)),
    ),
}


@pytest.mark.parametrize("name", NETWORKS)
def test_whether_bfloat16_pays(name):
    """On a processor without instructions for it, it does not, and `precision.mixed` leaves it."""
    torch.manual_seed(0)
    network, given = NETWORKS[name]()
    optimiser = torch.optim.Adam(network.parameters(), 1e-4)

    def step(low):
        with torch.autocast("cpu", torch.bfloat16, enabled=low):
            output = network(*given)
        loss = (output.float() - 0.3).abs().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()

    single, half = seconds(partial(step, False), partial(step, True), repeats=5)
    network.eval()
    with torch.no_grad():
        exact = network(*given)
        with torch.autocast("cpu", torch.bfloat16):
            rough = network(*given).float()
    off = float((rough - exact).abs().mean() / exact.abs().mean())
    print(
        f"\n{name}: a step in bfloat16 takes {half / single:.2f} of single precision, {100 * off:.1f} % off"
    )
    assert off < 0.05


def gathered(entries, numbers, weights):
    """What `_Interpolated` does, by plain indexing."""
    return (entries[numbers.long()] * weights[..., None]).sum(dim=-2)


@pytest.mark.parametrize("points", [512, 2**14])
def test_a_hash_grid(points, monkeypatch):
    """Of the small network of `nfvr`: sums of bags of entries, forward and with gradients, against plain indexing."""
    torch.manual_seed(0)
    grid = HashGrid(levels=16, features=2, table=2**15, growth=1.2)
    places = torch.rand(points, 3)

    def forward():
        with torch.no_grad():
            grid(places)

    def both():
        grid.entries.grad = None
        with deterministic():
            grid(places).square().sum().backward()

    bags = seconds(forward, both, repeats=5)
    monkeypatch.setattr(hash_grid._Interpolated, "apply", gathered)
    plain = seconds(forward, both, repeats=5)
    ratios = [ours / other for ours, other in zip(bags, plain, strict=True)]
    print("\n{} points: {:.2f} of plain indexing, {:.2f} with gradients".format(points, *ratios))
    assert ratios[0] < 1
