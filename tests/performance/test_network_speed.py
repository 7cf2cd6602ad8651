"""What the network of `elp` costs a frame: its order of memory, and modulation against concatenation."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import torch

from gibench.baselines.efficient_light_probes.network import GUIDES, ReconstructionNetwork
from tests.performance.turns import seconds

pytestmark = pytest.mark.performance

RESOLUTION = (320, 180)


def test_channels_last_and_the_fusions():
    torch.manual_seed(0)
    width, height = RESOLUTION
    image, guides = (torch.rand(1, channels, height, width) for channels in (3, GUIDES))
    networks = (
        ReconstructionNetwork().eval(),
        ReconstructionNetwork().to(memory_format=torch.contiguous_format).eval(),
        ReconstructionNetwork("concatenation").eval(),
    )
    with torch.inference_mode():
        found = seconds(*(partial(network, image, guides) for network in networks), repeats=15)
    ours, first, mixed = found
    print(
        f"\nthe network at {width} × {height}: {1e3 * ours:.0f} ms; with channels first {first / ours:.2f} times as "
        f"long, with concatenation {mixed / ours:.2f}"
    )
    assert np.isfinite(found).all()
