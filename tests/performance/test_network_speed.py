"""What the network of `elp` costs a frame: its order of memory, and modulation against concatenation."""

from __future__ import annotations

import time

import numpy as np
import pytest
import torch

from gibench.baselines.efficient_light_probes.network import GUIDES, ReconstructionNetwork

pytestmark = pytest.mark.performance

RESOLUTION = (320, 180)
ROUNDS = 15


def seconds(networks: dict[str, torch.nn.Module]) -> dict[str, float]:
    """Median of the time of a frame by network, in turns, so that all meet the same machine."""
    width, height = RESOLUTION
    generator = torch.Generator().manual_seed(3)
    image, guides = (torch.rand(1, count, height, width, generator=generator) for count in (3, GUIDES))
    spent: dict[str, list[float]] = {name: [] for name in networks}
    with torch.inference_mode():
        for number in range(ROUNDS + 2):
            for name, network in networks.items():
                begin = time.perf_counter()
                network(image, guides)
                if number >= 2:
                    spent[name].append(time.perf_counter() - begin)
    return {name: float(np.median(values)) for name, values in spent.items()}


def test_channels_last_and_the_fusions():
    torch.manual_seed(0)
    found = seconds(
        {
            "modulation": ReconstructionNetwork().eval(),
            "contiguous": ReconstructionNetwork().to(memory_format=torch.contiguous_format).eval(),
            "concatenation": ReconstructionNetwork("concatenation").eval(),
        }
    )
    ours = found["modulation"]
    print(
        f"\nthe network at {RESOLUTION[0]} × {RESOLUTION[1]}: {1e3 * ours:.0f} ms; with channels first "
        f"{found['contiguous'] / ours:.2f} times as long, with concatenation {found['concatenation'] / ours:.2f}"
    )
    assert np.isfinite(list(found.values())).all()
