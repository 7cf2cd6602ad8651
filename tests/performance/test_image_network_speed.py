"""What the networks from images to images cost a frame, and what a huge frame needs of memory."""

from __future__ import annotations

import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch

from gibench.baselines.image_to_image.examples import READ, Draw, Examples
from gibench.baselines.image_to_image.learner import IndirectLight, TrainingPlan
from gibench.baselines.image_to_image.shading import GEOMETRY, LIGHT
from gibench.baselines.image_to_image.units import Units
from gibench.baselines.training.learner import Step
from gibench.benchmarks.registry import installed
from gibench.rendering.camera import PinholeCamera
from tests.performance.turns import seconds

pytestmark = pytest.mark.performance

NAMES = ("gfa", "bcn", "pix2pix", "resnet", "deep-shading")

HUGE = """
import sys, torch
from gibench.benchmarks.memory import peak_mb, reset_peak
from gibench.benchmarks.registry import installed
method = installed().get(sys.argv[1]).method
net = method.load()(method.settings({"width": 0.125})).network().eval()
reset_peak()
before = peak_mb()
with torch.inference_mode():
    assert net(torch.rand(1, 2, 3, 1024, 2048), torch.randn(1, 7, 1024, 2048)).isfinite().all()
print(peak_mb() - before)
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


def test_a_frame_of_all_of_gfa():
    torch.manual_seed(0)
    method = installed().get("gfa").method
    network = method.load()(method.settings({"width": 1.0})).network().eval()
    frame = torch.rand(1, LIGHT, 3, 128, 192), torch.randn(1, GEOMETRY, 128, 192)
    with torch.inference_mode():
        (found,) = seconds(partial(network, *frame), repeats=5)
        (processor,) = seconds(partial(network, *frame), repeats=5, clock=time.process_time)
    threads = torch.get_num_threads()
    print(
        f"\ngfa with all of its channels at 192 × 128, {threads} threads: {found:.3f} s (reach 0.35), "
        f"{processor:.3f} s of processors"
    )
    # Beside other work the clock says how much of that there is.
    assert min(found, processor / threads) <= 0.35


class InMemory:
    """A frame of 192 × 128 that is mapped into memory, as in the cache, and checked as `Frames` checks it."""

    def __init__(self, folder: Path) -> None:
        channels = dict.fromkeys(READ, 3) | {"depth": 1}
        types = {"position": np.float32, "normal": np.float32, "depth": np.float32}
        self.arrays = {}
        for name, count in channels.items():
            values = np.random.default_rng(0).uniform(0.1, 4, (count, 128, 192))
            np.save(folder / f"{name}.npy", values.astype(types.get(name, np.float16)))
            self.arrays[name] = np.load(folder / f"{name}.npy", mmap_mode="c")

    def __len__(self) -> int:
        return 1

    def __getitem__(self, index: int) -> dict[str, torch.Tensor]:
        images = {name: torch.from_numpy(values).float().clone() for name, values in self.arrays.items()}
        for image in images.values():
            assert image.sum().isfinite()
        return images

    def camera(self, index: int) -> PinholeCamera:
        return PinholeCamera((0, 0, 1), (0, 3, 0.5), 1.0)

    def area_light(self, index: int) -> None:
        return None

    def exposure(self, index: int) -> float:
        return 1.0


def test_reading_and_drawing_are_a_tenth_of_a_step(tmp_path):
    """Of a step without the late losses, at half of the channels, on crops of 128 × 128; processor time."""
    torch.manual_seed(0)
    examples, draw = Examples(InMemory(tmp_path), Units()), Draw(128)
    functions = [lambda: draw(examples[0], np.random.default_rng(0))]
    for name in NAMES:
        method = installed().get(name).method
        made = method.load()(method.settings({"width": 0.5}))
        plan = TrainingPlan(128, 1, False, False, 0)
        learner = IndirectLight(made.network(), examples, examples, plan, mixed=made.mixed)
        batch = next(iter(learner.batches()(0)))
        functions.append(partial(learner.step, batch, Step(0, 0.1, np.random.default_rng(0))))
    reading, *steps = seconds(*functions, repeats=5, clock=time.process_time)
    shares = {name: reading / step for name, step in zip(NAMES, steps, strict=True)}
    print(f"\nreading and drawing {1e3 * reading:.2f} ms of a processor, of a step of ", end="")
    print(", ".join(f"{name} {100 * share:.1f} %" for name, share in shares.items()), "(reach 10)")
    assert max(shares.values()) <= 0.1


@pytest.mark.parametrize("name", NAMES)
def test_a_huge_frame_needs_memory_by_its_pixels(name):
    """All weights of the attention of `gfa` at 2048 × 1024 would be 2.1 GB, and as much again before the softmax."""
    done = subprocess.run([sys.executable, "-c", HUGE, name], capture_output=True, text=True, check=True)
    megabytes = float(done.stdout)
    assert megabytes > 0
    print(f"\n{name} at an eighth of its channels, 2048 × 1024: {megabytes:.0f} MB")
    assert megabytes < 3000
