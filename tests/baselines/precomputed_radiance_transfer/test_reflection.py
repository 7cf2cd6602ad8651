"""Kernels of lobes beside integrals and beside Mitsuba's own samples."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
import torch
from scipy.integrate import quad
from scipy.special import eval_legendre

from gibench.baselines.linearly_transformed_cosines.fitting import lobes
from gibench.baselines.precomputed_radiance_transfer.reflection import (
    cosine_kernel,
    lobe_kernel,
    reflectance,
)


def test_the_cosine():
    for band, value in enumerate(cosine_kernel(8)):
        expected = 2 * np.pi * quad(lambda x, band=band: x * eval_legendre(band, x), 0, 1)[0]
        assert value == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("alpha", [0.05, 0.2, 0.5, 1.0])
def test_a_lobe_is_that_of_mitsubas_half_vectors(alpha):
    side = (np.arange(512) + 0.5) / 512
    u, v = (part.ravel().astype(np.float32) for part in np.meshgrid(side, side))
    distribution = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, False)
    half = distribution.sample(mi.Vector3f(0, 0, 1), mi.Point2f(u, v))[0]
    cosine = 2 * np.array(half.z, np.float64) ** 2 - 1
    cosine = cosine[cosine > 0]
    expected = [eval_legendre(band, cosine).mean() for band in range(9)]
    found = lobe_kernel(torch.tensor([alpha]), 8)[0].numpy()
    np.testing.assert_allclose(found, expected, atol=3e-3)


def test_a_mirror_keeps_all_degrees_and_rougher_lobes_fewer():
    smooth, almost, rough = lobe_kernel(torch.tensor([0.0, 0.005, 0.3]), 8)
    np.testing.assert_array_equal(smooth, 1)
    np.testing.assert_allclose(almost, 1, atol=0.02)
    assert (rough.diff() < 0).all()
    assert rough[0] == 1


@pytest.mark.parametrize("alpha", [0.01, 0.15, 0.6])
@pytest.mark.parametrize("white", [0.04, 0.9])
def test_reflected_shares_are_those_of_mitsubas_lobes(alpha, white):
    cosines = np.array([1.0, 0.7, 0.3])
    expected = [lobe.mean(white + (1 - white) * lobe.schlick) for lobe in lobes(alpha, cosines)]
    specular = torch.full((3, 3), white)
    cosine = torch.from_numpy(cosines).float()
    found = reflectance(specular, torch.full((3,), alpha), cosine)
    np.testing.assert_allclose(found[:, 0], expected, rtol=0.05)


def test_matt_surfaces_have_no_lobe_and_nothing_reflects_more_than_all():
    alpha, cosine = torch.tensor([0.0, 1.0, 0.5]), torch.tensor([0.0, 1.0, -0.1])
    assert not reflectance(torch.zeros(3, 3), alpha, cosine).any()
    found = reflectance(torch.ones(3, 3), alpha, cosine)
    assert torch.isfinite(found).all()
    assert ((found >= 0) & (found <= 1)).all()
