"""Noise times time of our paths and of Mitsuba's `path` against Blender Cycles, in matt copies of rooms.

GIBENCH_BPY_PYTHON names a Python that has `bpy`, the package of Blender.
"""

from __future__ import annotations

import json
import os
import subprocess
import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from gibench.rendering.backend import select_variant

select_variant("auto")  # before what loads Dr.Jit, which must know by then where LLVM is

from gibench.rendering.render import render_frame  # noqa: E402
from gibench.rendering.scene import GUIDED  # noqa: E402
from gibench.stress import views  # noqa: E402
from tests.performance import matt_rooms  # noqa: E402
from tests.performance.test_noise import (  # noqa: E402
    RESOLUTION,
    SPP,
    _cpu_seconds,
    _room,
    measured,
    tell_means,
    tell_room,
)

BPY_PYTHON = os.environ.get("GIBENCH_BPY_PYTHON", "")

pytestmark = [
    pytest.mark.performance,
    pytest.mark.skipif(not BPY_PYTHON, reason="GIBENCH_BPY_PYTHON names no Python that has bpy"),
]

ROOMS = int(os.environ.get("GIBENCH_NOISE_ROOMS", "4"))
REPEATS = int(os.environ.get("GIBENCH_NOISE_REPEATS", "6"))
MAX_DEPTH = 8

TOLERANCE = 0.02
"""By which the light of whole frames may differ between renderers, relative."""

CYCLES = {
    "cycles": (),
    "cycles, lamps": ("lamps",),
    "cycles, portals": ("lamps", "portals"),
    "cycles, path guiding": ("lamps", "guiding"),
}
"""Options of `cycles_frames` by name."""


class Cycles:
    """A process that renders a room. As a context it ends when that is left.

    cpu_seconds: of the process, until its last frame.
    """

    def __init__(self, room: Path, *options: str) -> None:
        """room: as `matt_rooms.save` wrote it."""
        self._frame = room.with_name("-".join(("frame", *options)) + ".exr")
        script = Path(__file__).with_name("cycles_frames.py")
        # Blender's Python is not to see the packages of this one.
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        self._process = subprocess.Popen(
            [BPY_PYTHON, str(script), str(room), *options],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=environment,
        )
        self._listen()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        assert line, f"{BPY_PYTHON} with cycles_frames.py ended: run it by hand to see why"
        self.cpu_seconds = float(line)

    def __enter__(self) -> Cycles:
        return self

    def __exit__(self, *reason: object) -> None:
        self._process.kill()
        self._process.communicate()

    def render(self, seed: int, resolution: tuple[int, int], *, max_depth: int = MAX_DEPTH) -> np.ndarray:
        """(H, W, 3) radiance."""
        order = {"seed": seed, "resolution": resolution, "samples": SPP, "max_depth": max_depth}
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({**order, "file": str(self._frame)}) + "\n")
        self._process.stdin.flush()
        self._listen()
        return OpenEXR.File(str(self._frame)).channels()["RGB"].pixels


def path_through(scene, camera):
    """Mitsuba's `path`, as `measured` takes renderers."""

    def run(seed, resolution, max_depth=MAX_DEPTH):
        return views.render_path(
            scene.mi_scene, camera, resolution, spp=SPP, seed=seed, max_depth=max_depth, rr_depth=5
        )

    return run


def kept(runs, frames):
    """The same renderers; their frames of full size are added to `frames` by name."""

    def keeping(name, run):
        def same(seed, resolution):
            image = run(seed, resolution)
            if resolution == RESOLUTION:
                frames.setdefault(name, []).append(image)
            return image

        return same

    return {name: keeping(name, run) for name, run in runs.items()}


def assert_alike(frames, tolerance=TOLERANCE):
    """All renderers see the same, where what is bright and rare has not much more weight than the rest.

    frames: lists of images by name. Returns light of each over the mean of all.
    """
    means = {name: np.mean(images, axis=0, dtype=float) for name, images in frames.items()}
    typical = np.mean(list(means.values()), axis=0)
    weights = 1 / (typical + typical.mean())
    light = {
        name: float((weights * mean).mean() / (weights * typical).mean()) for name, mean in means.items()
    }
    assert max(light.values()) < (1 + tolerance) * min(light.values()), light
    return light


def matt(index, folder):
    """A generated room, its matt copy as a `Scene`, the file of that for Cycles, and the camera."""
    room, scene, camera = _room(index, folder)
    copy = matt_rooms.matt_room(room, scene)
    matt_rooms.save(copy, camera, scene.openings, folder / "matt.npz")
    return room, matt_rooms.mitsuba_scene(copy, scene.openings, folder / "matt"), folder / "matt.npz", camera


@pytest.mark.parametrize("index", [2, 3])
def test_cycles_counts_scattering_events_as_we_do(tmp_path, index):
    """By night and by day."""
    _, scene, file, camera = matt(index, tmp_path)
    path = path_through(scene, camera)
    with Cycles(file) as cycles:
        for depth in (1, 2):
            frames = {
                "path": [path(seed, RESOLUTION, depth) for seed in range(4)],
                "cycles": [cycles.render(seed, RESOLUTION, max_depth=depth) for seed in range(4)],
            }
            light = assert_alike(frames)
            print(f"\n{depth} scattering events: {light['cycles'] / light['path']:.4f} of the light of path")


def test_guided_and_plain_against_cycles(tmp_path):
    ratios: dict[str, list[tuple[float, ...]]] = {}
    for index in range(ROOMS):
        room, scene, file, camera = matt(index, tmp_path / str(index))
        day = room.environment.kind != "none"
        guided = replace(scene, sampling=GUIDED)
        _, learning = _cpu_seconds(lambda guided=guided: guided.guide)

        def ours(scene, camera=camera):
            return lambda seed, resolution: render_frame(
                scene,
                camera,
                resolution=resolution,
                spp=SPP,
                seed=seed,
                max_depth=MAX_DEPTH,
                channels=["color"],
            ).arrays["color"]

        frames: dict[str, list[np.ndarray]] = {}
        with ExitStack() as stack:
            processes = {
                name: stack.enter_context(Cycles(file, *options))
                for name, options in CYCLES.items()
                if "portals" not in options or (day and len(room.openings))
            }
            runs = {name: process.render for name, process in processes.items()}
            runs |= {"path": path_through(scene, camera), "plain": ours(scene), "guided": ours(guided)}

            def clock(processes=processes):
                return time.process_time() + sum(process.cpu_seconds for process in processes.values())

            found = measured(kept(runs, frames), REPEATS, clock)
        light = assert_alike(frames)
        print(
            f"\nroom {index}: {room.kind}, {'day' if day else 'night'}; guide learned in {learning:.1f} CPU s"
        )
        print("  light over the mean: " + ", ".join(f"{name} {value:.3f}" for name, value in light.items()))
        tell_room(found, learning, RESOLUTION[0] * RESOLUTION[1] * SPP, ratios, "cycles")
    print("\nof Cycles, geometric means over rooms (largest):")
    tell_means(ratios)
