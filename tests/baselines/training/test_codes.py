"""Codes of radiance against their formulas in double precision, there and back, and bounded whatever a network says."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from gibench.baselines.training.codes import LEAST_SLOPE, Exponential, LogCode, MuLaw
from gibench.baselines.training.errors import TrainingError

RADIANCE = np.concatenate([[0.0], np.logspace(-4, 5, 400)])
SAID = torch.tensor([-math.inf, -1e30, -50.0, -1.0, -0.3, 0.0, 0.7, 1.0, 3.0, 1e3, 1e30, math.inf])
CODES = [LogCode(), LogCode(50.0), MuLaw(), MuLaw(mu=5000, largest=8), Exponential(), Exponential(10, 0.1)]


def test_the_log_code_is_the_published_one():
    """clamp to [0, M], log(x + 1/e), mapped so that 0 is −1 and M is 1."""
    for largest in (10.0, 1e5):
        code = LogCode(largest)
        raw = np.log(np.clip(RADIANCE, 0, largest) + 1 / math.e)
        low, high = -1.0, math.log(largest + 1 / math.e)
        expected = 2 * (raw - low) / (high - low) - 1
        found = code.encode(torch.from_numpy(RADIANCE)).numpy()
        np.testing.assert_allclose(found, expected, atol=1e-14)
        ends = code.encode(torch.tensor([0.0, largest, 10 * largest, -3.0]))
        torch.testing.assert_close(ends, torch.tensor([-1.0, 1.0, 1.0, -1.0]))


def test_the_mu_law_is_the_published_one_and_leaves_three_points():
    code = MuLaw(10.0)
    x = np.concatenate([-RADIANCE[::-1], RADIANCE])
    expected = np.sign(x) * np.log(10 * np.abs(x) + 1) / np.log(11)
    np.testing.assert_allclose(code.encode(torch.from_numpy(x)).numpy(), expected, atol=1e-14)
    kept = torch.tensor([-1.0, 0.0, 1.0])
    torch.testing.assert_close(code.encode(kept), kept)


def test_the_exponential_turns_exposure_into_a_shift():
    code = Exponential()
    x = torch.logspace(-3, 2, 50, dtype=torch.float64)
    torch.testing.assert_close(code.decode(code.encode(x) + math.log(7)), 7 * x)


@pytest.mark.parametrize("code", CODES)
def test_there_and_back(code):
    x = torch.from_numpy(RADIANCE)
    x = x[(x <= code.largest) & (x >= getattr(code, "smallest", 0))]
    torch.testing.assert_close(code.decode(code.encode(x)), x, rtol=1e-11, atol=1e-12)
    single = x.float()
    # What single precision can tell of a code of order 1 near 0.
    near = 6e-8 * math.log1p(math.e * code.largest) if isinstance(code, LogCode) else 1e-7
    torch.testing.assert_close(code.decode(code.encode(single)), single, rtol=1e-5, atol=near)


@pytest.mark.parametrize("code", CODES)
def test_codes_rise_with_radiance(code):
    x = torch.from_numpy(RADIANCE)
    x = x[(x <= code.largest) & (x >= getattr(code, "smallest", 0))]
    assert (code.encode(x).diff() > 0).all()


@pytest.mark.parametrize("code", CODES)
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64, torch.bfloat16, torch.float16])
def test_whatever_a_network_says_is_finite_and_bounded(code, dtype):
    found = code.decode(SAID.to(dtype))
    assert found.dtype == (torch.float64 if dtype == torch.float64 else torch.float32)
    assert torch.isfinite(found).all()
    assert (found.abs() <= code.largest * (1 + 1e-6)).all()
    assert (found.diff() >= 0).all()
    if not isinstance(code, MuLaw):
        assert (found >= 0).all()


@pytest.mark.parametrize("code", CODES)
def test_gradients_are_finite_and_alive_within(code):
    said = SAID[1:-1].clone().requires_grad_(True)
    code.decode(said).sum().backward()
    assert torch.isfinite(said.grad).all()
    radiance = torch.tensor([0.0, 1e-4, 1.0, 1e5, 1e30]).requires_grad_(True)
    code.encode(radiance).sum().backward()
    assert torch.isfinite(radiance.grad).all()
    inside = code.encode(torch.tensor([0.5 * code.largest])).requires_grad_(True)
    code.decode(inside).sum().backward()
    assert inside.grad.abs().item() > 0


@pytest.mark.parametrize(
    "make",
    [
        lambda: LogCode(0),
        lambda: LogCode(math.inf),
        lambda: MuLaw(mu=-1),
        lambda: MuLaw(largest=math.nan),
        lambda: Exponential(1.0, 1.0),
        lambda: Exponential(1.0, 0.0),
    ],
)
def test_constants_that_make_no_code_are_named(make):
    with pytest.raises(TrainingError, match="code"):
        make()


def slope(code, said, upstream):
    said = torch.tensor(said, requires_grad=True)
    (upstream * code.decode(said)).backward()
    return float(said.grad)


def test_the_slope_of_the_exponential_is_its_own_value_within_the_bounds():
    code = Exponential(1e4, 1e-6)
    for said in (-3.0, 0.0, 1.5, 9.0):
        assert slope(code, said, 2.0) == pytest.approx(2 * math.exp(said), rel=1e-6)
    # Where exp is all but flat, it is that of LEAST_SLOPE.
    assert slope(code, -10.0, 2.0) == pytest.approx(2 * LEAST_SLOPE)


@pytest.mark.parametrize("said", [-1e30, -50.0, 50.0, 1e30])
def test_outside_of_the_bounds_gradients_lead_back_and_no_further(said):
    code = Exponential(1e4, 1e-6)
    outward = 1.0 if said < 0 else -1.0  # descending, a positive gradient makes less light
    assert slope(code, said, outward) == 0
    assert math.copysign(1, slope(code, said, -outward)) == -outward


@pytest.mark.parametrize("said", [-60.0, 60.0])
def test_what_a_network_says_comes_back_from_far_outside(said):
    """The loss is that of networks from images to images: L1 of log(1 + light)."""
    code = Exponential(1e4, 1e-6)
    value = torch.nn.Parameter(torch.full((4,), said))
    optimiser = torch.optim.Adam([value], lr=1.0)
    for _ in range(400):
        loss = (torch.log1p(code.decode(value)) - math.log(1.5)).abs().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        optimiser.param_groups[0]["lr"] *= 0.99
    torch.testing.assert_close(code.decode(value.detach()), torch.full((4,), 0.5), atol=0.05, rtol=0)
