"""1 − SSIM against scikit-image."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from skimage.metrics import structural_similarity

from gibench.baselines.training.losses.structural import SIDE, dissimilarity


def test_it_is_that_of_scikit_image():
    rng = np.random.default_rng(0)
    first, second = rng.random((2, 24, 30)), rng.random((2, 24, 30))
    _, images = zip(
        *(
            structural_similarity(
                a, b, data_range=2.0, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, full=True
            )
            for a, b in zip(first, second, strict=True)
        ),
        strict=True,
    )
    margin = SIDE // 2
    expected = 1 - np.mean([image[margin:-margin, margin:-margin] for image in images])
    ours = dissimilarity(torch.from_numpy(first)[None], torch.from_numpy(second)[None], span=2.0)
    assert float(ours) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("size", [(1, 1), (4, 40), (11, 11)])
def test_small_and_equal_images(size):
    image = torch.rand(1, 3, *size, requires_grad=True)
    assert float(dissimilarity(image.detach(), image.detach())) == pytest.approx(0, abs=1e-6)
    dissimilarity(image, torch.zeros_like(image)).backward()
    assert image.grad.isfinite().all()
