"""The networks have their published sizes, and are linear in how bright the light is."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from gibench.baselines.neural_precomputed_radiance_transfer import network as network_of
from gibench.baselines.neural_precomputed_radiance_transfer.environment import mean_radiance, picture_of
from gibench.baselines.neural_precomputed_radiance_transfer.network import (
    BRANCH_WIDTH,
    ONE_WIDTH,
    Branch,
    LightEncoder,
    TransferNetwork,
    towards_eye,
)
from gibench.baselines.neural_precomputed_radiance_transfer.training import in_units
from gibench.rendering.latlong import solid_angles
from gibench.rendering.lighting import EnvironmentMap
from gibench.rendering.panoramas import Panorama


def parameters(network):
    return sum(one.numel() for one in network.parameters())


def test_sizes_are_the_published_ones():
    assert parameters(LightEncoder()) == 290_848
    assert parameters(Branch(19, ONE_WIDTH)) == 186_947
    counts = {
        width: parameters(Branch(9, width)) + parameters(Branch(16, width)) for width in range(170, 178)
    }
    assert 194_226 not in counts.values()
    assert min(counts, key=lambda width: abs(counts[width] - 194_226)) == BRANCH_WIDTH
    assert counts[BRANCH_WIDTH] == 194_840


def pixels(count, seed=1):
    generator = torch.Generator().manual_seed(seed)
    material = torch.rand(count, 13, generator=generator)
    material[:, :6] = torch.randn(count, 6, generator=generator)
    for part in (slice(0, 3), slice(3, 6)):
        material[:, part] = torch.nn.functional.normalize(material[:, part], dim=1)
    return torch.rand(count, 3, generator=generator), material


@pytest.mark.parametrize("separated", [True, False])
def test_a_frame_is_what_training_sees(monkeypatch, separated):
    monkeypatch.setattr(network_of, "AT_ONCE", 16)
    torch.manual_seed(0)
    network = TransferNetwork(separated=separated).eval()
    points, material = pixels(50)
    picture = torch.rand(1, 3, 128, 256)
    with torch.no_grad():
        mean = torch.tensor([3.0, 2.0, 0.0])
        expected = network(points[None], material[None], picture, mean[None])[0]
        light = network.encoder(picture)[0]
    torch.testing.assert_close(network.frame(points, material, light, mean), expected, rtol=1e-4, atol=1e-5)
    once, twice = (network.frame(points, material, light, factor * mean) for factor in (1, 2))
    torch.testing.assert_close(twice, 2 * once, rtol=1e-6, atol=1e-6)
    assert not once[:, 2].any()
    assert not network.frame(points, material, light, 0 * mean).any()
    assert network.frame(points[:0], material[:0], light, mean).shape == (0, 3)


def test_black_surfaces_reflect_nothing():
    torch.manual_seed(0)
    network = TransferNetwork().eval()
    points, material = pixels(20)
    material[:, 7:] = 0
    assert not network.frame(points, material, torch.randn(64), torch.ones(3)).any()


def test_the_eye_is_where_it_was():
    normal = torch.tensor([[0.0, 0.0, 1.0]])
    eye = torch.nn.functional.normalize(torch.tensor([[0.3, -0.4, 0.7]]), dim=1)
    reflected = -eye + 2 * (eye * normal).sum() * normal
    torch.testing.assert_close(towards_eye(torch.cat([normal, reflected, torch.zeros(1, 7)], dim=1)), eye)


@pytest.mark.parametrize("height", [32, 128, 512])
def test_pictures_have_one_size_and_the_mean_of_the_sphere(height):
    pixels = np.random.default_rng(0).uniform(0, 2, (height, 2 * height, 3))
    pixels[1, 2] = 1e5
    picture = picture_of(EnvironmentMap(Panorama.of("made", pixels), 0.4))
    assert picture.shape == (3, 128, 256)
    weights = solid_angles(height)
    expected = (weights @ pixels.mean(axis=1)) / weights.sum()
    np.testing.assert_allclose(mean_radiance(picture), expected, rtol=1e-3)
    unit, mean = in_units(picture)
    np.testing.assert_allclose(mean_radiance(unit.numpy()), 1, rtol=1e-4)
    np.testing.assert_allclose(mean, expected, rtol=1e-3)
    assert LightEncoder()(unit[None]).isfinite().all()
    # A tint of the light is one of what it lights: the encoder sees the same.
    tinted = picture * np.float32([2, 0.5, 0])[:, None, None]
    torch.testing.assert_close(in_units(tinted)[0][:2], unit[:2])
    torch.testing.assert_close(in_units(tinted)[1], mean * torch.tensor([2, 0.5, 0]))
    assert not in_units(tinted)[0][2].any()
    assert not in_units(0 * picture)[1].any()
