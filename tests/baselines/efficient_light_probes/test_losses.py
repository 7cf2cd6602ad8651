"""The losses, against the metrics and against motion that is known."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.ndimage import map_coordinates

from gibench.baselines.efficient_light_probes import losses
from gibench.metrics import tone_map
from gibench.metrics.lpips_weights import weights_state


def test_warping_is_bilinear_and_holds_its_edges():
    generator = np.random.default_rng(0)
    image = generator.random((2, 3, 9, 12)).astype(np.float32)
    motion = generator.normal(0, 3, (2, 2, 9, 12)).astype(np.float32)
    rows, columns = np.mgrid[:9, :12].astype(np.float64)
    expected = np.array(
        [
            [map_coordinates(c, [rows + m[1], columns + m[0]], order=1, mode="nearest") for c in one]
            for one, m in zip(image, motion, strict=True)
        ]
    )
    found = losses.warped(torch.from_numpy(image), torch.from_numpy(motion))
    np.testing.assert_allclose(found.numpy(), expected, atol=1e-5)


def test_the_temporal_loss_is_zero_for_what_has_only_moved():
    before = torch.rand(1, 3, 10, 16)
    now = before.roll(3, dims=3)  # what is at x was at x − 3
    motion = torch.zeros(1, 2, 10, 16)
    motion[:, 0] = -3
    valid = torch.ones(1, 1, 10, 16)
    assert losses.temporal(now, before, motion, valid) < 1e-6
    assert losses.temporal(now, before, 0 * motion, valid) > 0.1
    mask = losses.seen_before(motion, valid)
    assert not mask[..., :3].any()
    assert mask[..., 3:].all()


def test_what_the_frame_before_did_not_see_is_left_out():
    now, before = torch.ones(1, 3, 4, 4), torch.zeros(1, 3, 4, 4)
    valid = torch.zeros(1, 1, 4, 4)
    motion = torch.zeros(1, 2, 4, 4)
    assert losses.temporal(now, before, motion, valid) == 0
    valid[..., 1, 2] = 1
    assert losses.temporal(now, before, motion, valid) == pytest.approx(1)


@pytest.mark.skipif(weights_state().state != "cached", reason="the weights of LPIPS are not here")
def test_the_perceptual_loss_is_lpips_of_display_values():
    from gibench.metrics import lpips
    from gibench.metrics.lpips_network import build_network

    generator = torch.Generator().manual_seed(0)
    first, second = (torch.rand(1, 3, 64, 64, generator=generator) for _ in range(2))
    first.requires_grad_()
    loss = losses.perceptual(build_network("vgg"), first, second, 1.3)
    images = (tone_map(one[0].movedim(0, -1).detach().numpy(), 1.3) for one in (first, second))
    assert float(loss.detach()) == pytest.approx(float(lpips(*images, net="vgg")), rel=1e-4)
    loss.backward()
    assert torch.isfinite(first.grad).all()
    assert first.grad.abs().max() > 0
