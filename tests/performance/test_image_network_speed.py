"""What the networks from images to images cost a frame, and what a huge frame needs of memory."""

from __future__ import annotations

import subprocess
import sys
from functools import partial

import numpy as np
import pytest
import torch

from gibench.baselines.image_to_image.shading import GEOMETRY, LIGHT
from gibench.benchmarks.registry import installed
from tests.performance.turns import seconds

pytestmark = pytest.mark.performance

NAMES = ("gfa", "bcn", "pix2pix", "resnet", "deep-shading")

HUGE = """
import resource, torch
from gibench.baselines.geometry_aware_feature_aggregation.network import GeometryAware, Size
net = GeometryAware(Size((8, 8, 24, 40, 56), (8, 8, 16, 24, 24), query=8)).eval()
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
with torch.inference_mode():
    assert net(torch.rand(1, 2, 3, 1024, 2048), torch.randn(1, 7, 1024, 2048)).isfinite().all()
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024)
"""


def test_a_frame_of_each():
    torch.manual_seed(0)
    frame = torch.rand(1, LIGHT, 3, 128, 192), torch.randn(1, GEOMETRY, 128, 192)
    networks = []
    for name in NAMES:
        method = installed().get(name).method
        networks.append(method.load()(method.settings({"width": 0.5})).network().eval())
    with torch.inference_mode():
        found = seconds(*(partial(network, *frame) for network in networks), repeats=5)
    print(f"\nat 192 × 128, half of the channels: gfa {1e3 * found[0]:.0f} ms; times as long: ", end="")
    print(", ".join(f"{name} {time / found[0]:.2f}" for name, time in zip(NAMES[1:], found[1:], strict=True)))
    assert np.isfinite(found).all()


def test_a_huge_frame_needs_memory_by_its_pixels():
    """All weights of the attention of 2048 × 1024 pixels would be 2.1 GB, and as much again before the softmax."""
    done = subprocess.run([sys.executable, "-c", HUGE], capture_output=True, text=True, check=True)
    megabytes = float(done.stdout)
    print(f"\ngfa at an eighth of its channels, 2048 × 1024: {megabytes:.0f} MB")
    assert megabytes < 3000
