"""Encodings against NumPy, SciPy and their own definitions."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from scipy.special import factorial, lpmv

from gibench.baselines.training.encodings.hash_grid import HashGrid
from gibench.baselines.training.encodings.positional import positional
from gibench.baselines.training.encodings.spherical_harmonics import spherical_harmonics
from gibench.baselines.training.errors import TrainingError
from gibench.baselines.training.reproducible import deterministic

DEGREE = 8


def directions(count=200, dtype=torch.float64):
    generator = torch.Generator().manual_seed(0)
    found = torch.nn.functional.normalize(
        torch.randn(count, 3, generator=generator, dtype=torch.float64), dim=-1
    )
    poles = torch.tensor([[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, -1, 0]], dtype=torch.float64)
    return torch.cat([found, poles]).to(dtype)


def test_spherical_harmonics_are_scipys():
    """Of its associated Legendre functions, which have the Condon-Shortley phase."""
    w = directions().numpy()
    polar, azimuth = np.arccos(np.clip(w[:, 2], -1, 1)), np.arctan2(w[:, 1], w[:, 0])
    found = spherical_harmonics(torch.from_numpy(w), DEGREE).numpy()
    assert found.shape == (len(w), (DEGREE + 1) ** 2)
    for band in range(DEGREE + 1):
        for m in range(-band, band + 1):
            share = (2 * band + 1) / (4 * math.pi) * factorial(band - abs(m)) / factorial(band + abs(m))
            value = np.sqrt(share) * lpmv(abs(m), band, np.cos(polar)) * (math.sqrt(2) if m else 1)
            expected = value * (np.cos(m * azimuth) if m >= 0 else np.sin(-m * azimuth))
            np.testing.assert_allclose(found[:, band**2 + band + m], expected, atol=1e-12)


def test_spherical_harmonics_are_orthonormal():
    z, weights = np.polynomial.legendre.leggauss(DEGREE + 1)
    azimuth = np.arange(2 * DEGREE + 2) * 2 * math.pi / (2 * DEGREE + 2)
    sine = np.sqrt(1 - z[:, None] ** 2)
    w = np.stack(
        [sine * np.cos(azimuth), sine * np.sin(azimuth), np.broadcast_to(z[:, None], (len(z), len(azimuth)))],
        -1,
    )
    basis = spherical_harmonics(torch.from_numpy(w), DEGREE).numpy().reshape(-1, (DEGREE + 1) ** 2)
    area = np.repeat(weights * 2 * math.pi / len(azimuth), len(azimuth))
    np.testing.assert_allclose(basis.T @ (area[:, None] * basis), np.eye(basis.shape[1]), atol=1e-12)


def test_the_first_harmonics_are_those_of_the_field():
    w = directions()
    x, y, z = w.unbind(-1)
    c0, c1 = math.sqrt(1 / (4 * math.pi)), math.sqrt(3 / (4 * math.pi))
    expected = torch.stack([torch.full_like(x, c0), -c1 * y, c1 * z, -c1 * x], -1)
    torch.testing.assert_close(spherical_harmonics(w, 1), expected)
    torch.testing.assert_close(spherical_harmonics(w, 0), expected[:, :1])


def test_bands_keep_their_energy_and_single_precision_suffices():
    """The addition theorem: the squares of a band add up to (2l + 1) / 4π."""
    found = spherical_harmonics(directions(dtype=torch.float32), DEGREE)
    for band in range(DEGREE + 1):
        total = found[:, band**2 : (band + 1) ** 2].square().sum(-1)
        torch.testing.assert_close(
            total, torch.full_like(total, (2 * band + 1) / (4 * math.pi)), rtol=1e-5, atol=0
        )
    w = directions(20).requires_grad_(True)
    assert torch.autograd.gradcheck(lambda v: spherical_harmonics(v, 4), (w,))


@pytest.mark.parametrize("dim", [-1, 1])
def test_positional_encoding_is_its_formula(dim):
    x = torch.rand(4, 5, 3, dtype=torch.float64) * 2 - 1
    found = positional(x, 10, dim=dim)
    x = x.movedim(dim, -1)
    found = found.movedim(dim, -1)
    count = x.shape[-1]
    assert found.shape[-1] == 2 * 10 * count
    for which, function in enumerate((torch.sin, torch.cos)):
        for level in range(10):
            for channel in range(count):
                expected = function(2.0 ** (level - 1) * math.pi * x[..., channel])
                at = (which * 10 + level) * count + channel
                torch.testing.assert_close(found[..., at], expected)


def test_34_channels_gain_680():
    assert positional(torch.zeros(1, 34, 2, 2), 10, dim=1).shape[1] == 680
    both = positional(torch.tensor([[-1.0], [1.0]]), 10)
    assert not torch.allclose(both[0], both[1])


def plain(grid, points):
    """The paper's section 3 in a loop, with the overflow of 32-bit numbers that it relies on."""
    entries = grid.entries.detach().double().numpy()
    found = []
    for point in points:
        features, start = [], 0
        for cells in grid.resolutions:
            count = min((cells + 1) ** 3, grid.table)
            scaled = np.asarray(point, dtype=np.float64) * cells
            low = np.minimum(np.floor(scaled), cells - 1).astype(np.int64)
            total = np.zeros(grid.features)
            for offset in np.ndindex(2, 2, 2):
                corner = low + offset
                weight = np.prod(np.where(offset, scaled - low, 1 - (scaled - low)))
                if (cells + 1) ** 3 <= grid.table:
                    index = int(corner @ [1, cells + 1, (cells + 1) ** 2])
                else:
                    with np.errstate(over="ignore"):
                        parts = corner.astype(np.uint32) * np.array(
                            [1, 2654435761, 805459861], dtype=np.uint32
                        )
                    index = int(np.bitwise_xor.reduce(parts) % np.uint32(grid.table))
                total += weight * entries[start + index]
            features.append(total)
            start += count
        found.append(np.concatenate(features))
    return np.array(found)


def filled(**given):
    torch.manual_seed(0)
    grid = HashGrid(**given)
    torch.nn.init.normal_(grid.entries)
    return grid


def test_the_hash_grid_is_a_plain_one():
    grid = filled(levels=6, features=3, table=2**9, base=4, growth=2.3)
    dense = [(cells + 1) ** 3 <= 2**9 for cells in grid.resolutions]
    assert dense == [True, False, False, False, False, False]
    assert grid.resolutions == [4, 9, 21, 48, 111, 257]
    generator = torch.Generator().manual_seed(1)
    points = torch.rand(60, 3, generator=generator, dtype=torch.float64)
    points = torch.cat([points, torch.tensor([[0, 0, 0], [1, 1, 1], [0, 1, 0.5], [1 / 3, 0.25, 1.0]])])
    found = grid.double()(points)
    assert found.shape == (64, 18) == (64, grid.channels)
    np.testing.assert_allclose(found.detach().numpy(), plain(grid, points.numpy()), rtol=1e-12, atol=1e-12)


def test_coarse_levels_interpolate_any_linear_function():
    grid = filled(levels=1, features=1, table=2**12, base=9)
    ticks = torch.arange(10) / 9
    z, y, x = torch.meshgrid(ticks, ticks, ticks, indexing="ij")
    with torch.no_grad():
        grid.entries[:, 0] = (1 + 2 * x - 3 * y + 5 * z).flatten()
    points = torch.rand(100, 3)
    expected = 1 + points @ torch.tensor([2.0, -3.0, 5.0])
    torch.testing.assert_close(grid(points)[:, 0], expected)


def test_features_are_continuous_and_clamped_at_the_cube():
    grid = filled(levels=4, table=2**8, base=3, growth=2.0).double()
    edge = torch.tensor([[1 / 3, 0.4, 0.7]], dtype=torch.float64)
    step = torch.tensor([[1e-9, 0, 0]], dtype=torch.float64)
    torch.testing.assert_close(grid(edge - step), grid(edge + step), atol=1e-6, rtol=0)
    outside = torch.tensor([[-2.0, 0.5, 7.0]], dtype=torch.float64)
    torch.testing.assert_close(grid(outside), grid(outside.clamp(0, 1)))
    assert grid(torch.rand(2, 5, 7, 3, dtype=torch.float64)).shape == (2, 5, 7, 8)


def test_gradients_reach_the_entries_and_repeat_their_bits():
    grid = filled(levels=3, features=2, table=2**6, base=2, growth=2.0).double()
    points = (torch.rand(5, 3, dtype=torch.float64) * 0.9 + 0.05).requires_grad_(True)
    assert torch.autograd.gradcheck(
        lambda p, e: torch.func.functional_call(grid, {"entries": e}, (p,)), (points, grid.entries)
    )
    many = torch.rand(20000, 3, dtype=torch.float64)
    bits = set()
    for _ in range(3):
        grid.entries.grad = None
        with deterministic():
            grid(many).square().sum().backward()
        bits.add(grid.entries.grad.numpy().tobytes())
    assert len(bits) == 1


def test_a_level_of_full_size_is_hashed_without_overflow():
    """Beyond 2³¹ a product of the primes needs all of 64 bits."""
    grid = filled(levels=1, features=1, table=2**10, base=2**20)
    points = torch.rand(50, 3, dtype=torch.float64)
    np.testing.assert_allclose(grid.double()(points).detach().numpy(), plain(grid, points.numpy()), atol=1e-9)


def test_sizes_that_make_no_grid_are_named():
    for given in ({"table": 1000}, {"table": 0}, {"levels": 0}, {"growth": 0.5}, {"growth": math.nan}):
        with pytest.raises(TrainingError, match="hash"):
            HashGrid(**given)


def test_the_grid_of_neural_free_viewpoint_relighting_has_its_size():
    """32 levels of 2 features from 16 cells on, tables of 2¹⁹: 107 MB of 2²⁰ bytes where levels grow by 1.3."""
    with torch.device("meta"):
        grid = HashGrid(levels=32, features=2, table=2**19, base=16, growth=1.3)
    assert 4 * grid.entries.numel() / 2**20 == pytest.approx(107, abs=0.5)


def test_it_learns_a_function_that_has_edges():
    torch.manual_seed(0)
    grid = HashGrid(levels=6, features=2, table=2**12, base=4, growth=1.6)
    head = torch.nn.Linear(grid.channels, 1)
    optimiser = torch.optim.Adam([*grid.parameters(), *head.parameters()], 2e-2)
    points = torch.rand(2000, 3)
    truth = ((points - 0.5).norm(dim=1) < 0.35).float()
    for _ in range(60):
        loss = (head(grid(points))[:, 0] - truth).square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    assert float(loss.detach()) < 0.15 * float(truth.var())
