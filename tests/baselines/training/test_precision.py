"""Half precision is for processors that multiply it, and networks learn in it what they learn in single precision."""

import pytest
import torch
from torch import nn

from gibench.baselines.training import precision
from gibench.baselines.training.reproducible import seeded

CPU = torch.device("cpu")


@pytest.fixture(params=[False, True], ids=["no-bfloat16", "bfloat16"])
def multiplies(request, monkeypatch):
    monkeypatch.setattr(precision, "multiplies", lambda: request.param)
    return request.param


def test_any_of_its_instructions_will_do(monkeypatch):
    for name in precision.INSTRUCTIONS:
        assert hasattr(torch.cpu, name)  # torch still calls it that
        monkeypatch.setattr(torch.cpu, name, lambda: False)
    assert not precision.multiplies()
    for name in precision.INSTRUCTIONS:
        with monkeypatch.context() as one:
            one.setattr(torch.cpu, name, lambda: True)
            assert precision.multiplies()


def test_a_torch_without_those_words_has_none(monkeypatch):
    for name in precision.INSTRUCTIONS:
        monkeypatch.delattr(torch.cpu, name)
    assert not precision.multiplies()


def test_products_are_of_bfloat16_where_a_processor_multiplies_them(multiplies):
    layer = nn.Linear(3, 2)
    with precision.mixed(CPU):
        output = layer(torch.ones(1, 3))
    assert output.dtype == (torch.bfloat16 if multiplies else torch.float32)
    output.float().sum().backward()
    assert layer.weight.dtype == layer.weight.grad.dtype == torch.float32


def test_another_device_keeps_its_precision(multiplies):
    with precision.mixed(torch.device("meta")):
        assert nn.Linear(3, 2)(torch.ones(1, 3)).dtype == torch.float32


def test_a_network_learns_in_it(multiplies):
    with seeded(0):
        network = nn.Sequential(nn.Linear(1, 32), nn.ReLU(), nn.Linear(32, 1))
        given = torch.linspace(-1, 1, 256)[:, None]
    asked = torch.sin(3 * given)
    optimiser = torch.optim.Adam(network.parameters(), 1e-2)
    for _ in range(300):
        with precision.mixed(CPU):
            output = network(given).float()
        optimiser.zero_grad()
        (output - asked).abs().mean().backward()
        optimiser.step()
    # Judged in single precision, as a network is used; sin has a mean of .66.
    assert (network(given) - asked).abs().mean() < 0.05
