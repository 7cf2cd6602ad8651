"""The process of a result: prepares a method for a scene and renders its frames, setting by setting.

One preparation serves all settings that it is valid for; each setting is a result of its own. A process without a scene
trains a method on rooms. What happens is told to the process that started this one, message by message: a pair of a
name and a content.

    ("ready", seconds)      the renderer and the scene are loaded
    ("trained", dict)       times of the training
    ("prepared", dict)      times of the preparation
    ("waits", None)         until it has the machine to itself, where several workers share one
    ("alone", None)         it has
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
import shutil
import signal
import sys
import time
import traceback
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from gibench.baselines.bakes import Bake, BakeCache
from gibench.baselines.method import Method, Prediction, Setting, Site, View
from gibench.baselines.sources import digest
from gibench.baselines.stages import Stages, synchronise
from gibench.baselines.trained import trained
from gibench.baselines.training_set import TrainingSet, training_set
from gibench.benchmarks import predictions, turns
from gibench.benchmarks.costs import preparation
from gibench.benchmarks.memory import gpu_peak_mb, peak_mb, reset_peak
from gibench.benchmarks.scenes import SceneFiles, lay_out
from gibench.datasets.files import sync_tree, through_no_link
from gibench.errors import GibenchError

#: Lane of the random numbers that methods are given, far from those of the generators and the references.
METHOD_LANE = 2000

#: Stands for the number of the room in the random numbers of a training on all rooms.
ROOMS = 2**31

#: Bytes left on a disk from which it counts as full: a failure with less cannot be told from one that is the disk's.
FULL = 16 * 2**20


@dataclass(frozen=True)
class Task:
    """Task of one process.

    scene: None for the process that trains on rooms. settings: (knobs, folder for the frames) of every result, all with
    the same baked settings. training: root of the dataset of training views, None where the method reads none. rooms:
    where what is trained on rooms is kept; None on tracks that train for each scene. site: folder for the files of the
    scene that a method may see. bakes: root of the cache. machine: what bakes depend on beside the scene. seconds: of a
    training. parts: of the image that are scored. log: where output and tracebacks of crashes go. turn: see `turns`;
    None where no other worker is on the machine.
    """

    method: Method
    seed: int
    scene: SceneFiles | None
    settings: tuple[tuple[dict[str, Setting], Path], ...]
    training: Path | None
    rooms: Path | None
    site: Path
    bakes: Path
    machine: dict[str, Any]
    seconds: float | None
    parts: tuple[str, ...]
    warmup: int
    variant: str
    threads: int
    log: Path
    turn: Path | None = None


def method_seed(seed: int, room: int, *more: int) -> int:
    """32 bits for a method: of its preparation, or with the number of the frame of that frame."""
    return int(np.random.SeedSequence(seed, spawn_key=(room, METHOD_LANE, *more)).generate_state(1)[0])


def work(connection: Connection, task: Task) -> None:
    """Body of the process."""
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
        if disk_refused(problem, task.bakes):
            connection.send(("storage", getattr(problem, "filename", None) or ""))
            return
        text = " ".join(str(problem).split())
        reason = text if isinstance(problem, GibenchError) else f"{type(problem).__name__}: {text}"
        with suppress(OSError):
            connection.send(("failed", {"reason": reason, "traceback": traceback.format_exc()}))


def disk_refused(problem: BaseException, folder: Path) -> bool:
    """Whether a failure is the disk's and none of the method's, so that it must not stay as a result.

    Libraries wrap what the system says, or lose it and say that a file cannot be written: then the room that is left
    decides. folder: where bakes go.
    """
    chain: BaseException | None = problem
    while chain is not None:
        if isinstance(chain, OSError) and chain.errno in (errno.ENOSPC, errno.EDQUOT):
            return True
        chain = chain.__cause__ or chain.__context__
    there = next(place for place in (folder, *folder.parents) if place.exists())
    return shutil.disk_usage(there).free < FULL


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

        with turns.beside(task.turn):
            backend.select_variant(task.variant)
            backend.limit_threads(task.threads)
        if task.scene is None:
            self._train(started)
        else:
            _SceneSession(self.connection, task, task.scene).run(started)

    def _train(self, started: float) -> None:
        """Train on rooms; whoever prepares for a scene finds the weights."""
        with turns.beside(self.task.turn):
            views, cache = on_rooms(self.task)
            self.connection.send(("ready", time.perf_counter() - started))
            reset_peak()
            started = time.perf_counter()
            bake = weights_of(self.task, cache, views, room=None)
            wall = time.perf_counter() - started
        cost = preparation(wall, {}, [bake], [bake], [views])
        self.connection.send(("trained", {**cost, "peak_mb": peak_mb(), "gpu_mb": gpu_peak_mb()}))


def on_rooms(task: Task) -> tuple[TrainingSet, BakeCache]:
    """Training data of a method and the folder of its weights, on a track that trains on rooms."""
    assert task.rooms is not None
    views = training_set(task.training)
    return views, BakeCache(task.rooms, "rooms", task.machine, views)


def weights_of(task: Task, cache: BakeCache, views: TrainingSet, room: int | None) -> Bake:
    """The weights of the method of a task. room: None where it trains on many."""
    seed = method_seed(task.seed, ROOMS if room is None else room)
    return trained(cache, task.method, task.settings[0][0], views, seconds=task.seconds, seed=seed)


class _SceneSession:
    def __init__(self, connection: Connection, task: Task, scene: SceneFiles) -> None:
        self.connection, self.task, self.scene = connection, task, scene
        self.rig: Any = None

    def run(self, started: float) -> None:
        task = self.task
        with turns.beside(task.turn):  # from loading on: somebody may be measuring
            implementation = self._prepared(started)
        for number, (settings, frames) in enumerate(task.settings):
            if number:
                adjust = getattr(implementation, "adjust", None)
                if adjust is None:
                    return
                with turns.beside(task.turn):
                    adjust(settings)
            with turns.alone(task.turn, self._waits):
                if task.turn is not None:
                    self.connection.send(("alone", None))
                result = self._rendered(implementation, frames)
            self.connection.send(("result", result))

    def _prepared(self, started: float) -> Any:
        """Load renderer and scene, prepare the method, and tell what that took. Its implementation."""
        from gibench.rendering.scene import load_scene

        task, files = self.task, self.scene
        folder = lay_out(files, task.site)
        scene = load_scene(folder / "scene.xml", share_kernels=True)
        kinds = {shot.lighting.kind for shot in files.shots}
        if kinds != {"own"}:
            from gibench.rendering.light_rig import LightRig

            self.rig = LightRig(scene, panoramas="environment" in kinds)
            scene = self.rig.scene
        views = [training_set(None if task.rooms else task.training, files.room)]
        bakes = BakeCache(task.bakes, files.sha256, task.machine, views[0])
        caches = [bakes]
        if task.method.trains and task.rooms is not None:
            rooms, cache = on_rooms(task)
            views, caches = [*views, rooms], [*caches, cache]
        stages = Stages()
        site = Site(
            scene=scene,
            folder=folder,
            resolution=files.resolution,
            training=views[0],
            seed=method_seed(task.seed, files.room),
            bakes=bakes,
            stages=stages,
            max_depth=files.max_depth,
            seconds=task.seconds,
            parts=task.parts,
            rig=self.rig,
        )
        implementation_class = task.method.load()
        # Read the sources that bakes are keyed by outside of the clock.
        digest(implementation_class.__module__)
        self.connection.send(("ready", time.perf_counter() - started))

        reset_peak()
        synchronise()
        started = time.perf_counter()
        if task.method.trains:
            room = files.room if task.rooms is None else None
            weights = weights_of(task, caches[-1], views[-1], room)
            site = replace(site, weights=weights.folder)
        implementation = implementation_class(task.settings[0][0])
        implementation.prepare(site)
        synchronise()
        wall = time.perf_counter() - started
        used = [bake for cache in caches for bake in cache.used]
        made = [bake for cache in caches for bake in cache.made]
        prepared = preparation(wall, stages.seconds, used, made, views)
        self.connection.send(("prepared", {**prepared, "peak_mb": peak_mb(), "gpu_mb": gpu_peak_mb()}))
        return implementation

    def _waits(self) -> None:
        self.connection.send(("waits", None))

    def _rendered(self, implementation: Any, folder: Path) -> dict[str, Any]:
        """Render the frames, the clock around every call; check and keep each frame outside of it."""
        resolution = self.scene.resolution
        folder.mkdir(parents=True)
        reset_peak()
        started = time.perf_counter()
        for frame in range(min(self.task.warmup, len(self.scene))):
            # Frame 0 of the real ones forgets them.
            self._light(frame)
            predictions.checked(implementation.render(self._view(frame), Stages()), resolution)
        synchronise()
        warmup = time.perf_counter() - started
        frames, files, kinds = [], {}, None
        for frame in range(len(self.scene)):
            lighting = self._light(frame)
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
                parts = predictions.checked(prediction, resolution)
            except predictions.BadPrediction as problem:
                raise predictions.BadPrediction(f"frame {frame}: {problem}") from None
            if frame and parts.keys() != kinds:
                raise predictions.BadPrediction(f"frame {frame}: some parts are there in some frames only")
            kinds = parts.keys()
            content = predictions.encode({part: parts[part] for part in parts if part in self.task.parts})
            name = f"{frame:04d}.exr"
            (folder / name).write_bytes(content)
            files[name] = {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}
            frames.append(
                {
                    "seconds": seconds,
                    "stages": stages.seconds,
                    "lighting_seconds": lighting,
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

    def _light(self, frame: int) -> float:
        """Light the scene as a frame has it, which is no method's work; the seconds that it took."""
        if self.rig is None:
            return 0.0
        synchronise()
        started = time.perf_counter()
        self.rig.set(self.scene.shots[frame].lighting)
        synchronise()
        return time.perf_counter() - started

    def _view(self, frame: int) -> View:
        before = self.scene.before(frame)
        return View(
            shot=self.scene.shots[frame],
            previous=None if before is None else self.scene.shots[before],
            resolution=self.scene.resolution,
            index=frame,
            seed=method_seed(self.task.seed, self.scene.room, frame),
        )


def _number(value: Any) -> float | None:
    """A number of a method's own; None for what JSON has no number for."""
    return float(value) if math.isfinite(value) else None
