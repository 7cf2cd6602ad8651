"""A renderer that takes no time, so that what surrounds it can be tested: it is put in the place of the generators
and of Mitsuba inside the worker processes, and its pixels depend on the frame's seed alone."""

from __future__ import annotations

import os
import signal
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from gibench.datasets.pool import Report, Work
from gibench.datasets.recipes import Recipe
from gibench.datasets.room_making import RoomMaker
from gibench.errors import GibenchError
from gibench.generators.parts import Camera
from gibench.rendering.channels import CHANNELS, PARTS

FACTS: dict[str, Any] = {
    "variant": "fake",
    "versions": {"gibench": "0", "mitsuba": "0"},
    "gpu": None,
}


class RejectedRoom(GibenchError):
    pass


def pixels(channels: tuple[str, ...], resolution: tuple[int, int], seed: int) -> dict[str, np.ndarray]:
    """Arrays such as a renderer returns, among them denormals, zeros and values beyond half."""
    rng = np.random.default_rng(seed)
    width, height = resolution
    arrays: dict[str, np.ndarray] = {}
    for name, channel in CHANNELS.items():
        shape = (height, width, channel.components)
        if channel.dtype == "uint":
            arrays[name] = rng.integers(0, 9, shape).astype(np.uint32)
        elif channel.set == "radiance":
            arrays[name] = np.exp(rng.uniform(-9, 3, shape)).astype(np.float32)
        else:
            arrays[name] = rng.uniform(0, 1, shape).astype(np.float32)
    arrays["color"] = np.sum([arrays[name] for name in PARTS], axis=0, dtype=np.float32)
    return {name: arrays[name] for name in channels}


def render_frame(scene: Any, camera: Any, **settings: Any) -> SimpleNamespace:
    width, height = settings["resolution"]
    arrays = pixels(settings["channels"], (width, height), settings["seed"])
    spp = settings.get("spp") or settings["spp_cap"]
    return SimpleNamespace(
        arrays=arrays,
        spp=spp,
        paths=spp * width * height,
        invalid_paths=0,
        median_error=0.1 if spp > 1 else float("nan"),
        kernel_seconds=0.001,
        denoise_seconds=0.0,
        denoise_change=0.0,
        seconds=0.001,
    )


def sample_room(seed: int, index: int, *, kinds: tuple[str, ...], views: int, **_: Any) -> SimpleNamespace:
    camera = Camera((0.0, 0.0, 1.5), (1.0, 0.0, 1.5), 1.2)
    return SimpleNamespace(
        index=index,
        kind=kinds[0],
        cameras=(camera,) * views,
        given_cameras=0,
        lightings=(),
        rejections={"view: too dark": 1},
    )


def write_room(room: SimpleNamespace, folder: Path, **_: Any) -> None:
    for name in ("room.json", "scene.xml", "room.glb"):
        (Path(folder) / name).write_text(f"{name} of {room.index}", encoding="utf-8")


@dataclass
class Setup:
    """Puts the fakes in place. slow: seconds a frame. rejects: rooms that cannot be built. facts: what to answer.

    seconds: what a frame says that it took.
    """

    slow: float = 0.0
    rejects: tuple[int, ...] = ()
    facts: dict[str, Any] = field(default_factory=lambda: FACTS)
    seconds: float = 0.001

    def __call__(self) -> dict[str, Any]:
        def sampled(seed: int, index: int, **settings: Any) -> SimpleNamespace:
            if index in self.rejects:
                raise RejectedRoom("nothing fits")
            return sample_room(seed, index, **settings)

        def rendered(scene: Any, camera: Any, **settings: Any) -> SimpleNamespace:
            time.sleep(self.slow)
            frame = render_frame(scene, camera, **settings)
            frame.seconds = self.seconds
            return frame

        scene = SimpleNamespace(materials=("oak",), shapes=("floor.0",), guide=None)
        modules = {
            "gibench.generators.rooms": {"sample_room": sampled, "RejectedRoom": RejectedRoom},
            "gibench.generators.scene_files": {"write_room": write_room, "lighting_record": None},
            "gibench.rendering.scene": {"load_scene": lambda path, share_kernels, sampling: scene},
            "gibench.rendering.render": {"render_frame": rendered},
        }
        for name, content in modules.items():
            module = ModuleType(name)
            vars(module).update(content)
            sys.modules[name] = module
        return self.facts


@dataclass
class Killed:
    """A job whose process gets a signal in the middle of one room, the first `times` times."""

    job: RoomMaker
    room: int
    times: int
    with_signal: int = signal.SIGKILL

    def __call__(self, room: int, report: Report) -> Any:
        tries = self.job.root.parent / "tries"
        if room == self.room:
            count = len(tries.read_text()) if tries.exists() else 0
            tries.write_text("x" * (count + 1))
            if count < self.times:
                (self.job.root / "rooms" / f".{room:06d}.partial-{os.getpid()}").mkdir(parents=True)
                os.kill(os.getpid(), self.with_signal)
        return self.job(room, report)


@dataclass
class Broken:
    """A job that raises `problem` in one room."""

    job: RoomMaker
    room: int
    problem: Exception

    def __call__(self, room: int, report: Report) -> Any:
        if room == self.room:
            raise self.problem
        return self.job(room, report)


def fake_work(root: Path, recipe: Recipe, **setup: Any) -> Work:
    return Work(Setup(**setup), RoomMaker(root, recipe))


def tiny(rooms: int = 3, **changes: Any) -> Recipe:
    values = {"rooms": rooms, "views": 2, "resolution": (16, 12), "spp": 4, "denoise": False}
    return Recipe.model_validate(values | changes)


@dataclass(frozen=True)
class Pids:
    """Work that does nothing: the setup answers the worker's process, the job takes `seconds`."""

    seconds: float = 0.0

    def __call__(self, room: int | None = None, report: Report | None = None) -> int:
        if room:
            time.sleep(self.seconds)
        return os.getpid()


@dataclass(frozen=True)
class Asleep:
    """A setup that waits for what never comes."""

    def __call__(self) -> None:
        time.sleep(600)


@dataclass(frozen=True)
class Answer:
    """A setup or job that gives the same answer every time."""

    answer: Any

    def __call__(self, *_: Any) -> Any:
        return self.answer
