"""The process of a result: prepares a method for a scene and renders the path, setting by setting.

One preparation serves all settings that it is valid for; each setting is a result of its own. What happens is told
to the process that started this one, message by message: a pair of a name and a content.

    ("ready", seconds)      the renderer and the scene are loaded
    ("prepared", dict)      times of the preparation
    ("result", dict)        one setting is done; its frames lie in its partial folder
    ("failed", dict)        reason, traceback; the process ends
    ("storage", str)        the disk refuses; the process ends
    ("done", None)          all settings, or all that this object can serve
"""

from __future__ import annotations

import errno
import faulthandler
import hashlib
import io
import math
import os
import resource
import signal
import sys
import threading
import time
import traceback
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from gibench.baselines.bakes import Bake, BakeCache
from gibench.baselines.method import Method, Prediction, Setting, Site, View
from gibench.baselines.sources import digest
from gibench.baselines.stages import Stages, synchronise
from gibench.benchmarks import predictions
from gibench.benchmarks.scenes import SceneFiles, TrainingViews, training_views
from gibench.datasets.files import sync_tree, through_no_link
from gibench.datasets.pool import end_with_parent, leave_signals_to_parent
from gibench.errors import GibenchError

#: Lane of the random numbers that methods are given, far from those of the generators and the references.
METHOD_LANE = 2000

#: What a preparation is booked under, beside what none of them names.
BOOKED = ("lightmap", "probes", "references", "training")


@dataclass(frozen=True)
class Task:
    """What one process does.

    settings: (knobs, folder for the frames) of every result, all with the same baked settings. training: root of the
    dataset of training views, None where the method reads none. bakes: root of the cache. machine: what bakes depend
    on beside the scene. log: where output and tracebacks of crashes go.
    """

    method: Method
    seed: int
    scene: SceneFiles
    settings: tuple[tuple[dict[str, Setting], Path], ...]
    training: Path | None
    bakes: Path
    machine: dict[str, Any]
    warmup: int
    variant: str
    threads: int
    log: Path


def method_seed(seed: int, room: int, *more: int) -> int:
    """32 bits for a method: of its preparation, or with the number of the frame of that frame."""
    return int(np.random.SeedSequence(seed, spawn_key=(room, METHOD_LANE, *more)).generate_state(1)[0])


def work(connection: Connection, task: Task) -> None:
    """Body of the process."""
    leave_signals_to_parent()
    threading.Thread(target=end_with_parent, daemon=True).start()
    log = open(task.log, "wb", buffering=0, opener=through_no_link)  # noqa: SIM115 - as long as the process
    for stream in (1, 2):
        os.dup2(log.fileno(), stream)
    for text in (sys.stdout, sys.stderr):
        if isinstance(text, io.TextIOWrapper):
            text.reconfigure(line_buffering=True, errors="replace")  # a crash must not swallow what was said
    faulthandler.enable(log)
    faulthandler.register(signal.SIGUSR1, log)  # asked for before a process that takes too long is killed
    try:
        _Session(connection, task).run()
        connection.send(("done", None))
    except Exception as problem:
        sys.stdout.flush()
        if isinstance(problem, OSError) and problem.errno in (errno.ENOSPC, errno.EDQUOT):
            connection.send(("storage", problem.filename or ""))
            return
        text = " ".join(str(problem).split())
        reason = text if isinstance(problem, GibenchError) else f"{type(problem).__name__}: {text}"
        with suppress(OSError):
            connection.send(("failed", {"reason": reason, "traceback": traceback.format_exc()}))


class _Session:
    def __init__(self, connection: Connection, task: Task) -> None:
        self.connection, self.task = connection, task

    def run(self) -> None:
        task = self.task
        started = time.perf_counter()
        # Read when torch is loaded. Its threads then sleep while they wait: one that spins keeps a renderer's, or
        # another process's, from what it is waiting for.
        os.environ.setdefault("OMP_NUM_THREADS", str(task.threads))
        os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
        from gibench.rendering import backend
        from gibench.rendering.scene import load_scene

        backend.select_variant(task.variant)
        backend.limit_threads(task.threads)
        scene = load_scene(task.scene.folder / "scene.xml", share_kernels=True)
        views = training_views(task.training, task.scene.room)
        bakes = BakeCache(task.bakes, task.scene.sha256, task.machine)
        stages = Stages()
        site = Site(
            scene=scene,
            folder=task.scene.folder,
            resolution=task.scene.resolution,
            training=views,
            seed=method_seed(task.seed, task.scene.room),
            bakes=bakes,
            stages=stages,
        )
        implementation_class = task.method.load()
        digest(
            implementation_class.__module__
        )  # reads the sources that bakes are keyed by, outside of the clock
        self.connection.send(("ready", time.perf_counter() - started))

        before = {path.name for path in task.bakes.iterdir()} if task.bakes.is_dir() else set()
        reset_peak()
        synchronise()
        started = time.perf_counter()
        implementation = implementation_class(task.settings[0][0])
        implementation.prepare(site)
        synchronise()
        wall = time.perf_counter() - started
        made = [bake for bake in bakes.used if bake.folder.name not in before]
        prepared = preparation(wall, stages.seconds, bakes.used, made, views)
        self.connection.send(("prepared", {**prepared, "peak_mb": peak_mb(), "gpu_mb": gpu_peak_mb()}))

        for number, (settings, folder) in enumerate(task.settings):
            if number:
                adjust = getattr(implementation, "adjust", None)
                if adjust is None:
                    return
                adjust(settings)
            self.connection.send(("result", self._rendered(implementation, folder)))

    def _rendered(self, implementation: Any, folder: Path) -> dict[str, Any]:
        """Render the path, the clock around every call; check and keep each frame outside of it."""
        cameras = len(self.task.scene.cameras)
        folder.mkdir(parents=True)
        reset_peak()
        started = time.perf_counter()
        for frame in range(min(self.task.warmup, cameras)):
            # A short path of its own: frame 0 of the real one forgets it.
            predictions.checked(
                implementation.render(self._view(frame), Stages()), self.task.scene.resolution
            )
        synchronise()
        warmup = time.perf_counter() - started
        frames, files, kinds = [], {}, None
        for frame in range(cameras):
            stages = Stages()
            view = self._view(frame)
            synchronise()
            started = time.perf_counter()
            prediction = implementation.render(view, stages)
            if isinstance(prediction, Prediction):
                prediction.finish()
            synchronise()
            seconds = time.perf_counter() - started
            try:
                parts = predictions.checked(prediction, self.task.scene.resolution)
            except predictions.BadPrediction as problem:
                raise predictions.BadPrediction(f"frame {frame}: {problem}") from None
            if frame and parts.keys() != kinds:
                raise predictions.BadPrediction(f"frame {frame}: some parts are there in some frames only")
            kinds = parts.keys()
            content = predictions.encode(parts)
            name = f"{frame:04d}.exr"
            (folder / name).write_bytes(content)
            files[name] = {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}
            frames.append(
                {
                    "seconds": seconds,
                    "stages": stages.seconds,
                    "extra": {key: _number(value) for key, value in prediction.extra.items()},
                }
            )
        sync_tree(folder)
        return {
            "warmup_seconds": warmup,
            "frames": frames,
            "files": files,
            "peak_mb": peak_mb(),
            "gpu_mb": gpu_peak_mb(),
        }

    def _view(self, frame: int) -> View:
        from gibench.rendering.camera import PinholeCamera

        scene = self.task.scene
        return View(
            camera=PinholeCamera(*scene.cameras[frame]),
            previous=PinholeCamera(*scene.cameras[frame - 1]) if frame else None,
            resolution=scene.resolution,
            index=frame,
            seed=method_seed(self.task.seed, scene.room, frame),
        )


def _number(value: Any) -> float | None:
    """A number of a method's own; None for what JSON has no number for."""
    return float(value) if math.isfinite(value) else None


def preparation(
    wall: float,
    stages: dict[str, float],
    used: list[Bake],
    made: list[Bake],
    views: TrainingViews,
) -> dict[str, Any]:
    """What a preparation cost, whoever paid for it first.

    wall: seconds of `prepare`. stages: seconds by stage in it. used: bakes that it read, made: those of them that were
    not there before. A bake that was there counts with what making it took; so do the views that were handed out.
    Returns seconds (all of it), one entry for each of `BOOKED`, other, bytes of the bakes, wall, and lists.
    """
    booked = dict.fromkeys(BOOKED, 0.0)
    booked["references"] = views.seconds
    other = 0.0
    for bake in used:
        if bake.kind in booked:
            booked[bake.kind] += bake.seconds
        else:
            other += bake.seconds
    in_stages = 0.0
    for name, seconds in stages.items():
        # A stage around the making of a bake of its name holds the same seconds once more.
        seconds = max(0.0, seconds - sum(bake.seconds for bake in made if bake.kind == name))
        in_stages += seconds
        if name in booked:
            booked[name] += seconds
        else:
            other += seconds
    other += max(0.0, wall - in_stages - sum(bake.seconds for bake in made))
    return {
        "seconds": sum(booked.values()) + other,
        **booked,
        "other": other,
        "bytes": sum(bake.size for bake in used),
        "wall_seconds": wall,
        "made_seconds": sum(bake.seconds for bake in made),
        "stages": dict(stages),
        "bakes": [
            {"kind": bake.kind, "folder": bake.folder.name, "seconds": bake.seconds, "bytes": bake.size}
            for bake in used
        ],
        "training_views_read": len(views.handed_out),
    }


def reset_peak() -> None:
    """Forget the peak of memory so far, where the system can (Linux; the GPU always)."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
    if drjit := sys.modules.get("drjit"):
        drjit.detail.malloc_clear_statistics()
    torch = sys.modules.get("torch")
    if torch is not None and torch.cuda.is_available() and torch.cuda.is_initialized():
        torch.cuda.reset_peak_memory_stats()


def peak_mb() -> float:
    """Largest resident memory of this process since `reset_peak`, in 10⁶ bytes."""
    with suppress(OSError):
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024 / 1e6
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def gpu_peak_mb() -> float | None:
    """Largest memory on the GPU since `reset_peak`, in 10⁶ bytes; None without one."""
    total, is_there = 0.0, False
    mitsuba, drjit = sys.modules.get("mitsuba"), sys.modules.get("drjit")
    if mitsuba is not None and drjit is not None and str(mitsuba.variant()).startswith("cuda"):
        total, is_there = total + drjit.detail.malloc_watermark(drjit.JitBackend.CUDA), True
    torch = sys.modules.get("torch")
    if torch is not None and torch.cuda.is_available() and torch.cuda.is_initialized():
        total, is_there = total + torch.cuda.max_memory_allocated(), True
    return total / 1e6 if is_there else None
