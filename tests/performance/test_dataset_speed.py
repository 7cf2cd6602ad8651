"""Measured figures of making and reading datasets: `pytest -m performance -s tests/performance/test_dataset_speed.py`.

They are printed with what is to be reached; nothing is asserted, since a busy machine is no mistake of the code.
"""

import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import psutil
import pytest

from gibench.datasets import load_preset, open_dataset
from gibench.datasets.making import Progress, make
from gibench.datasets.manifest import read_manifest
from gibench.rendering.channels import SETS

pytestmark = pytest.mark.performance


@pytest.fixture(scope="module")
def small(tmp_path_factory) -> Path:
    """`make-dataset --rooms 10 --preset small`."""
    root = tmp_path_factory.mktemp("small") / "d"
    make(root, load_preset("small", {"rooms": 10}))
    return root


def test_wall_time_against_time_in_kernels(small):
    (run,) = read_manifest(small)["runs"]
    totals = read_manifest(small)["totals"]
    laps = {lap: round(seconds, 1) for lap, seconds in totals["room_seconds"].items()}
    print(
        f"\nmake-dataset --rooms 10 --preset small: {run['wall_seconds']:.1f} s, of which kernels "
        f"{run['kernel_seconds']:.1f} s: {run['wall_seconds'] / run['kernel_seconds']:.3f} x (reach 1.25); "
        f"denoising {totals['denoise_seconds']:.1f} s; laps {laps}; 200 rooms would take "
        f"{run['wall_seconds'] / 10 * 200 / 60:.0f} min (reach 60)"
    )


def test_reading_color_and_surface(small):
    seconds = []
    for frame in open_dataset(small):
        frame.read("color")  # the file is in the page cache afterwards
        for _ in range(5):
            started = time.perf_counter()
            frame.read("color", *SETS["surface"])
            seconds.append(time.perf_counter() - started)
    print(f"\nreading color + surface of a 256x192 frame: {1e3 * np.median(seconds):.1f} ms (reach 15)")


def test_help():
    code = "from gibench.cli import make_dataset; make_dataset()"
    seconds = []
    for _ in range(5):
        started = time.perf_counter()
        subprocess.run([sys.executable, "-c", code, "--help"], check=True, capture_output=True)
        seconds.append(time.perf_counter() - started)
    print(f"\nmake-dataset --help: {np.median(seconds):.2f} s (reach 0.7)")


def test_memory_of_workers_over_a_hundred_rooms(tmp_path):
    """Peak resident memory of the run with its workers, and its growth from room 20 to room 100."""
    recipe = load_preset("small", {"rooms": 100, "views": 1, "spp": 4, "resolution": (128, 96)})
    peaks: list[float] = [0.0] * 101
    now = 0
    ended = threading.Event()

    def watch() -> None:
        this = psutil.Process()
        while not ended.wait(0.1):
            try:
                resident = sum(p.memory_info().rss for p in this.children(recursive=True))
            except psutil.NoSuchProcess:
                continue
            peaks[now] = max(peaks[now], resident)

    def count(progress: Progress) -> None:
        nonlocal now
        now = progress.rooms_done

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    make(tmp_path / "d", recipe, on_progress=count)
    ended.set()
    watcher.join()
    mebibytes = np.array(peaks) / 2**20
    growth = (mebibytes[80:].max() - mebibytes[:20].max()) / 80
    print(
        f"\npeak resident memory of the worker: {mebibytes.max():.0f} MiB (reach 1500); "
        f"growth from room 20 to 100: {growth:.2f} MiB a room (reach 1); by tens of rooms: "
        + " ".join(f"{part.max():.0f}" for part in np.array_split(mebibytes[:100], 10))
    )
