"""Running a track: scenes made, every result in a process of its own, whatever stops a run survived."""

from __future__ import annotations

import errno
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import gibench
from gibench.benchmarks import machine as machines
from gibench.benchmarks import worker
from gibench.benchmarks.code_version import code_version
from gibench.benchmarks.errors import Interrupted, ResultsError, RunError, TrackError
from gibench.benchmarks.registry import Found
from gibench.benchmarks.result_files import FORMAT, RunFolder, key_of
from gibench.benchmarks.scenes import SceneFiles, scene_name, scenes_in
from gibench.benchmarks.settings import Choice, base_settings, choices
from gibench.benchmarks.track import Preset, Track
from gibench.datasets.making import Progress, default_threads, make
from gibench.rendering.channels import resolve

#: Seconds that a process may take until renderer and scene are loaded.
STARTUP_SECONDS = 600.0

#: Seconds that a process which takes too long is given to say where it is.
LAST_WORDS = 1.0

#: What a run's time goes to; the rest of it is the harness.
SPENT = ("scenes", "prepare", "render", "score")


@dataclass(frozen=True)
class Order:
    """What a command asks for.

    methods: with their settings, in the order in which they run. rooms, seeds: None takes the preset's. scenes: keys
    of a recipe that put scene files in the place of rooms. command: how to do the same again, for the record and for
    messages.
    """

    track: Track
    preset: str
    methods: tuple[tuple[Found, tuple[Choice, ...]], ...]
    rooms: int | None = None
    scenes: Mapping[str, Any] = field(default_factory=dict)
    seeds: tuple[int, ...] | None = None
    variant: str = "auto"
    threads: int = field(default_factory=lambda: default_threads(1))
    retry_failed: bool = False
    command: str = ""

    @property
    def size(self) -> Preset:
        """The preset itself."""
        return self.track.preset(self.preset)

    @property
    def room_count(self) -> int:
        """How many rooms or scenes."""
        return len(self.scenes.get("scenes", ())) or self.rooms or self.size.rooms


def ordered_methods(
    track: Track, preset: str, methods: Sequence[Found], overrides: Mapping[str, Mapping[str, Any]]
) -> tuple[tuple[Found, tuple[Choice, ...]], ...]:
    """Methods with the settings that a preset and the user ask for.

    Raises TrackError for a method that does not run on the track or lacks a channel of the training views,
    MethodError for settings that do not exist.
    """
    size = track.preset(preset)
    stored = size.recipe("training").channels
    result = []
    for found in methods:
        method = found.method
        if track.id not in method.tracks:
            raise TrackError(
                f"method '{method.id}' does not run on track {track.id}, but on {', '.join(method.tracks)}"
            )
        if missing := [channel for channel in resolve(method.channels) if channel not in stored]:
            raise TrackError(
                f"method '{method.id}' needs channel {', '.join(missing)} of the training views, which {track.id}, "
                f"preset {preset}, does not store: copy the track (`gibench bench list --track {track.id} --show`), "
                f"add it to channels under [presets.{preset}.training], and run with --track COPY.toml"
            )
        result.append((found, tuple(choices(method, size.plan(method), overrides.get(method.id, {})))))
    return tuple(result)


@dataclass(frozen=True)
class Job:
    """One result that is to be there."""

    found: Found
    choice: Choice
    scene: SceneFiles
    seed: int
    config: dict[str, Any]
    key: str

    @property
    def id(self) -> str:
        """Sixteen hexadecimal digits."""
        return self.key[:16]


@dataclass
class State:
    """How far a run is, for whoever watches. record: of the result that has just been written."""

    done: int = 0
    of: int = 0
    failed: int = 0
    record: dict[str, Any] | None = None
    scenes: Progress | None = None


@dataclass(frozen=True)
class Report:
    """What a run came to. ids: of all results that were asked for. made, failed: how many now.

    seconds: of all of it, by what they were spent on; "harness" is what is neither scenes, preparing, rendering nor
    scoring.
    """

    ids: tuple[str, ...]
    made: int
    failed: tuple[str, ...]
    seconds: dict[str, float]


class Run:
    """A run over one folder, whose lock is held by `RunFolder.claimed`."""

    def __init__(self, folder: RunFolder, order: Order, on_state: Callable[[State], None]) -> None:
        """Nothing happens yet."""
        self.folder, self.order, self.on_state = folder, order, on_state
        self.state = State()
        self.spent = dict.fromkeys(SPENT, 0.0)
        self.started = time.perf_counter()
        self.began = datetime.now(UTC)
        self.run: dict[str, Any] = {}
        self.scenes: list[SceneFiles] = []
        self.facts: dict[str, Any] = {}
        self.machine = ""
        self.made: list[str] = []
        self.failed: list[str] = []

    def prepare(self) -> None:
        """Look at the machine, make the scenes, write `run.json`."""
        order = self.order
        self._check_identity()
        self.facts = machines.examine(order.variant, order.threads)
        self.machine = machines.digest(self.facts)
        self._write_run()
        began = time.perf_counter()
        for which in ("reference", "reference-again"):
            self._make(which)
        if any(found.method.channels for found, _ in order.methods):
            self._make("training")
        self.spent["scenes"] += time.perf_counter() - began
        self.scenes = [s for s in scenes_in(*self.folder.references) if s.room < order.room_count]

    def _identity(self) -> dict[str, Any]:
        """What all results of a folder have in common. Rooms may be added."""
        size, scenes = self.order.size, self.order.scenes
        return {
            "track": self.order.track.id,
            "preset": self.order.preset,
            "warmup": size.warmup,
            "training": size.recipe("training", scenes=scenes).identity(),
            "reference": size.recipe("reference", scenes=scenes).identity(),
        }

    def _check_identity(self) -> None:
        if not self.folder.run_file.exists():
            return
        self.run = self.folder.read_run()
        there, asked = self.run["identity"], self._identity()
        for name in ("track", "preset", "warmup", "reference", "training"):
            if there.get(name) != asked[name]:
                what = (
                    f"{there.get(name)}, asked was {asked[name]}"
                    if isinstance(asked[name], str | int)
                    else "other"
                )
                raise ResultsError(
                    f"{self.folder.root} holds a run with another {name} ({what}): to continue it run "
                    f"`{self.run['command']}`, for a new one choose another --out"
                )

    def _write_run(self) -> None:
        track = self.order.track
        plans = {
            found.method.id: base_settings(found.method, self.order.size.plan(found.method))
            for found, _ in self.order.methods
        }
        self.run = {
            "format": FORMAT,
            "gibench": gibench.__version__,
            "track": track.id,
            "title": track.title,
            "question": track.question,
            "preset": self.order.preset,
            "seed": self.order.size.seed,
            "parts": list(track.parts),
            "metrics": list(track.metrics),
            "sequence_metrics": list(track.sequence_metrics),
            "created": self.began.isoformat(timespec="seconds"),
            "equal_time": [],
            "runs": [],
            **{key: value for key, value in self.run.items() if key in ("created", "equal_time", "runs")},
            "command": self.order.command,
            "identity": self._identity(),
            "base_settings": {**self.run.get("base_settings", {}), **plans},
            "machine": {**self.facts, "id": self.machine},
            "machines": {**self.run.get("machines", {}), self.machine: self.facts},
        }
        self.folder.write_run(self.run)

    def _make(self, which: Any) -> None:
        order = self.order
        rooms = order.room_count
        if (manifest := self.folder.dataset(which) / "dataset.json").exists():
            from gibench.datasets.manifest import read_manifest

            rooms = max(rooms, int(read_manifest(manifest.parent)["recipe"]["rooms"]))
        recipe = order.size.recipe(which, rooms, order.scenes)

        def tell(progress: Progress) -> None:
            self.state.scenes = progress
            self.on_state(self.state)

        (self.folder.root / "scenes").mkdir(exist_ok=True)
        make(
            self.folder.dataset(which), recipe, variant=order.variant, command=order.command, on_progress=tell
        )
        self.state.scenes = None

    def jobs(self, methods: Sequence[tuple[Found, Sequence[Choice]]]) -> list[Job]:
        """Every result that is to be there, scene by scene."""
        seeds = self.order.seeds or self.order.size.seeds
        versions = {found.method.id: code_version(found) for found, _ in methods}
        training = key_of({"recipe": self._identity()["training"]})
        result = []
        for scene in self.scenes:
            for found, chosen in methods:
                method = found.method
                for seed in seeds if method.trained else seeds[:1]:
                    for choice in chosen:
                        config = {
                            "track": self.order.track.id,
                            "scene": scene.name,
                            "scene_sha256": scene.sha256,
                            "frames": len(scene.cameras),
                            "resolution": list(scene.resolution),
                            "warmup": self.order.size.warmup,
                            "training": training if method.channels else None,
                            "method": method.id,
                            "knobs": choice.settings,
                            "seed": seed,
                            "code": versions[method.id],
                            "machine": self.machine,
                        }
                        result.append(Job(found, choice, scene, seed, config, key_of(config)))
        return result

    def do(self, jobs: Sequence[Job]) -> None:
        """Make the results that are not there. Raises RunError for a full disk."""
        waiting = [job for job in jobs if not self._is_there(job)]
        self.state.of += len(jobs)
        self.state.done += len(jobs) - len(waiting)
        self.state.record = None
        self.on_state(self.state)
        groups: dict[tuple[Any, ...], list[Job]] = {}
        for job in waiting:
            baked = job.found.method.baked_settings(job.choice.settings)
            groups.setdefault((job.scene.name, job.found.method.id, job.seed, repr(baked)), []).append(job)
        for group in groups.values():
            while group:
                group = group[self._serve(group) :]

    def _is_there(self, job: Job) -> bool:
        if not self.folder.result_file(job.id).exists():
            return False
        if self.folder.read_result(job.id)["status"] == "ok":
            return True
        if self.order.retry_failed:
            self.folder.put_aside(job.id)
            return False
        self.failed.append(job.id)
        self.state.failed = len(self.failed)
        return True

    def _serve(self, group: list[Job]) -> int:
        """Start a process for some results of one preparation; returns how many are there now, at least one."""
        first = group[0]
        order = self.order
        self.folder.logs.mkdir(exist_ok=True)
        log = self.folder.logs / f"{first.id}.log"
        task = worker.Task(
            method=first.found.method,
            seed=first.seed,
            scene=first.scene,
            settings=tuple((job.choice.settings, self.folder.partial(job.id)) for job in group),
            training=self.folder.dataset("training") if first.found.method.channels else None,
            bakes=self.folder.bakes(first.scene.name),
            machine={"machine": self.machine},
            warmup=order.size.warmup,
            variant=self.facts["variant"],
            threads=order.threads,
            log=log,
        )
        with _Process(task) as process:
            served, prepared = 0, None
            phase, clock = "start", time.perf_counter()
            while True:
                limit = {
                    "start": STARTUP_SECONDS,
                    "prepare": order.size.budget.prepare,
                    "render": order.size.budget.render,
                }[phase]
                kind, content = process.heard(limit)
                spent = time.perf_counter() - clock
                clock = time.perf_counter()
                if kind == "ready":
                    phase = "prepare"
                elif kind == "prepared":
                    self.spent["prepare"] += content["wall_seconds"]
                    prepared, phase = content, "render"
                elif kind == "result":
                    self.spent["render"] += content["warmup_seconds"] + sum(
                        f["seconds"] for f in content["frames"]
                    )
                    self._keep(self._good(group[served], prepared or {}, content))
                    served += 1
                elif kind == "done":
                    log.unlink(missing_ok=True)
                    return served
                elif kind == "storage":
                    raise OSError(errno.ENOSPC, "the disk is full", content)
                else:  # failed, died or too late
                    if phase != "start":
                        self.spent[phase] += spent
                    # A preparation that fails, fails for all settings that it was for.
                    lost = group[served : served + 1] if phase == "render" else group
                    for job in lost:
                        self._keep(self._bad(job, phase, content, prepared, log))
                    return served + len(lost)

    def _base(self, job: Job) -> dict[str, Any]:
        method = job.found.method
        return {
            "format": FORMAT,
            "gibench": gibench.__version__,
            "id": job.id,
            "key": job.key,
            "config": job.config,
            "title": method.title,
            "family": method.family,
            "paper": method.paper,
            "label": job.choice.label,
            "room": job.scene.room,
            "kind": job.scene.kind,
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "machine": self.facts,
        }

    def _good(self, job: Job, prepared: dict[str, Any], rendered: dict[str, Any]) -> dict[str, Any]:
        return {
            **self._base(job),
            "status": "ok",
            "prepare": prepared,
            "warmup_seconds": rendered["warmup_seconds"],
            "frames": rendered["frames"],
            "peak_mb": rendered["peak_mb"],
            "gpu_mb": rendered["gpu_mb"],
            "files": rendered["files"],
        }

    def _bad(
        self, job: Job, phase: str, content: dict[str, str], prepared: dict[str, Any] | None, log: Path
    ) -> dict[str, Any]:
        where = {
            "start": "before the preparation",
            "prepare": "in the preparation",
            "render": "while rendering",
        }
        return {
            **self._base(job),
            "status": "failed",
            "phase": phase,
            "reason": _printable(f"{where[phase]}: {content['reason']}"),
            "traceback": _printable(content["traceback"]),
            "log": _tail(log),
            "prepare": prepared,
        }

    def _keep(self, record: dict[str, Any]) -> None:
        self.folder.write_result(record)
        (self.made if record["status"] == "ok" else self.failed).append(record["id"])
        self.state.done += 1
        self.state.failed = len(self.failed)
        self.state.record = record
        self.on_state(self.state)
        self.state.record = None

    def finish(self, ids: Sequence[str]) -> Report:
        """Write down what was done and what it took."""
        total = time.perf_counter() - self.started
        seconds = {"total": total, **self.spent, "harness": max(0.0, total - sum(self.spent.values()))}
        self.run["runs"] = [
            *self.run["runs"],
            {
                "command": self.order.command,
                "began": self.began.isoformat(timespec="seconds"),
                "machine": self.machine,
                "made": len(self.made),
                "failed": len(self.failed),
                "seconds": seconds,
            },
        ]
        self.folder.write_run(self.run)
        return Report(tuple(ids), len(self.made), tuple(self.failed), seconds)


def run(
    root: Path,
    order: Order,
    *,
    work: Callable[[Run], list[Job]] | None = None,
    score: Callable[[Run], None] | None = None,
    on_state: Callable[[State], None] = lambda state: None,
) -> Report:
    """Make every result that is asked for and not there yet.

    root: folder of the results; new, empty, or of the same track and preset. work: does other results than those of
    `order.methods`, and says which (see `equal_time`). score: called when they are there, its time is that of scoring.
    on_state: told of every step.

    Raises FolderError, ResultsError, TrackError, MethodError before anything is made; RunError and Interrupted
    half-way, when the same call continues.
    """
    folder = RunFolder(root)
    with folder.claimed():
        doing = Run(folder, order, on_state)
        try:
            doing.prepare()
            if work is not None:
                jobs = work(doing)
            else:
                jobs = doing.jobs(order.methods)
                doing.do(jobs)
            if score is not None:
                began = time.perf_counter()
                score(doing)
                doing.spent["score"] += time.perf_counter() - began
            return doing.finish([job.id for job in jobs])
        except KeyboardInterrupt:
            done = f"{doing.state.done} of {doing.state.of} results" if doing.state.of else "no result"
            again = f"to continue run `{order.command}`" if order.command else "the same call continues"
            raise Interrupted(f"stopped with {done} there; {again}") from None
        except OSError as problem:
            raise RunError(_why(root, problem)) from None


def _why(root: Path, problem: OSError) -> str:
    if problem.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"{root}: the disk is full: free some space, then run the same command again to continue"
    return f"{problem.filename or root}: {problem.strerror}"


def _tail(log: Path, characters: int = 4000) -> str:
    with suppress(OSError):
        return log.read_text(encoding="utf-8", errors="replace")[-characters:]
    return ""


def _printable(text: str) -> str:
    """Text that UTF-8 can hold, whatever an exception said."""
    return text.encode("utf-8", "replace").decode()


class _Process:
    """A worker process, gone when the context is left."""

    def __init__(self, task: worker.Task) -> None:
        self.task = task

    def __enter__(self) -> _Process:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        self.connection: Connection = ours
        self.process = context.Process(target=worker.work, args=(theirs, self.task), daemon=True)
        self.process.start()
        theirs.close()
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.join()
        self.connection.close()

    def heard(self, limit: float) -> tuple[str, Any]:
        """The next message; ("lost", reason and traceback) where the process dies or takes over `limit` seconds."""
        if not self.connection.poll(limit):
            with suppress(OSError):
                os.kill(self.process.pid or 0, signal.SIGUSR1)
            time.sleep(LAST_WORDS)
            reason = f"it took more than {limit:g} s, the track's limit"
            return "lost", {"reason": reason, "traceback": _tail(self.task.log)}
        try:
            return tuple(self.connection.recv())
        except (EOFError, OSError):
            self.process.join()
            code = self.process.exitcode or 0
            how = f"killed by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
            hint = " (out of memory?)" if code == -signal.SIGKILL else ""
            reason = f"its process was {how}{hint}" if code < 0 else f"its process {how}"
            return "lost", {"reason": reason, "traceback": _tail(self.task.log)}


def failures(root: Path) -> list[tuple[str, str]]:
    """What failed in a folder: (label, reason)."""
    folder = RunFolder(root)
    records = (folder.read_result(id) for id in folder.ids())
    return [
        (f"{scene_name(r['room'])} {r['label']}", r["reason"]) for r in records if r["status"] == "failed"
    ]
