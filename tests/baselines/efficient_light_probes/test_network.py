"""The reconstruction network and what it makes of radiance."""

from __future__ import annotations

import pytest
import torch

from gibench.baselines.efficient_light_probes.network import (
    BRIGHTEST,
    CHANNELS,
    FUSIONS,
    GUIDES,
    Modulation,
    ReconstructionNetwork,
    Scale,
)


def disturbed(fusion="modulation"):
    """A network whose last layer is not 0 any more."""
    torch.manual_seed(0)
    network = ReconstructionNetwork(fusion)
    torch.nn.init.normal_(network.last.weight, std=0.1)
    return network


@pytest.mark.parametrize("fusion", FUSIONS)
@pytest.mark.parametrize(("height", "width"), [(8, 8), (24, 40), (180, 320), (13, 7), (1, 1)])
def test_any_size_goes_in_and_comes_out(fusion, height, width):
    output = disturbed(fusion)(torch.rand(2, 3, height, width), torch.rand(2, GUIDES, height, width))
    assert output.shape == (2, 3, height, width)
    assert torch.isfinite(output).all()


@pytest.mark.parametrize("fusion", FUSIONS)
def test_untrained_it_hands_its_input_through(fusion):
    image = torch.rand(1, 3, 12, 20)
    assert torch.equal(ReconstructionNetwork(fusion)(image, torch.rand(1, GUIDES, 12, 20)), image)


def test_modulation_is_equation_5():
    torch.manual_seed(1)
    module, image, guides = Modulation(4), torch.randn(1, 4, 3, 5), torch.randn(1, 4, 3, 5)
    first, second = (
        torch.einsum("oc,nchw->nohw", layer.weight[:, :, 0, 0], guides) + layer.bias[:, None, None]
        for layer in (module.weight, module.shift)
    )
    assert torch.allclose(module(image, guides), first * image + second, atol=1e-6)


def test_every_level_is_modulated_by_the_guides():
    """With the image's features held at 0 what is left is the shift, which the guides alone decide."""
    network = disturbed()
    image = torch.zeros(1, 3, 16, 16)
    for layer in network.image:
        torch.nn.init.zeros_(layer.weight)
        torch.nn.init.zeros_(layer.bias)
    guides = torch.rand(1, GUIDES, 16, 16)
    for level in range(len(CHANNELS)):
        before = network(image, guides)
        torch.nn.init.normal_(network.fusions[level].shift.weight)
        assert not torch.allclose(network(image, guides), before)


def test_what_is_far_away_reaches_a_pixel():
    """Three halvings see at least 30 pixels around; without the deep levels it would be 2."""
    network = disturbed()
    image = torch.rand(1, 3, 64, 64, requires_grad=True)
    network(image, torch.rand(1, GUIDES, 64, 64))[0, 0, 32, 32].backward()
    rows = torch.nonzero(image.grad.abs().sum(dim=(0, 1, 3)))
    assert int(rows.max() - rows.min()) + 1 >= 30


def test_parameters_are_counted():
    def convolution(inputs, outputs, side):
        return inputs * outputs * side * side + outputs

    a, b, c, d = CHANNELS
    encoder = sum(
        convolution(inputs, a, 3) + convolution(a, b, 3) + convolution(b, c, 3) + convolution(c, d, 3)
        for inputs in (3, GUIDES)
    )
    fusion = sum(2 * convolution(count, count, 1) for count in CHANNELS)
    decoder = (
        convolution(d, c, 4) + convolution(2 * c, b, 4) + convolution(2 * b, a, 4) + convolution(2 * a, 3, 3)
    )
    assert ReconstructionNetwork().parameter_count == encoder + fusion + decoder


@pytest.mark.parametrize("exposure", [1e-6, 1.0, 1e6])
def test_compression_is_undone(exposure):
    scale = Scale(exposure, 1.0)
    radiance = torch.tensor([0.0, 1e-6, 1e-3, 0.18, 1.0, 30.0, 1e6]) / exposure
    back = scale.radiance(scale.compressed(radiance))
    assert torch.allclose(back, radiance, rtol=1e-4, atol=1e-7 / exposure)
    assert scale.compressed(torch.zeros(1)) == 0


def test_whatever_comes_out_is_finite_and_not_negative():
    values = torch.tensor([-1e30, -1.0, 0.0, 10.0, BRIGHTEST, 1e30])
    for exposure in (1e-6, 1.0, 1e6):
        radiance = Scale(exposure, 1.0).radiance(values)
        assert torch.isfinite(radiance).all()
        assert (radiance >= 0).all()


def test_depth_is_measured_in_the_depth_of_the_scene():
    buffers = torch.rand(GUIDES, 4, 5)
    larger = buffers.clone()
    larger[0] *= 100
    assert torch.allclose(Scale(1.0, 2.0).guides(buffers), Scale(1.0, 200.0).guides(larger))
    assert torch.equal(Scale(1.0, 2.0).guides(buffers)[1:], buffers[1:])
