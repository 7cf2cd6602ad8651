"""Running a track: scenes made, every result in a process of its own, whatever stops a run survived."""

from __future__ import annotations

import errno
import os
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gibench
from gibench.benchmarks import machine as machines
from gibench.benchmarks import serving, worker
from gibench.benchmarks.code_version import code_version
from gibench.benchmarks.errors import Interrupted, ResultsError, RunError
from gibench.benchmarks.orders import Order
from gibench.benchmarks.outcomes import Job
from gibench.benchmarks.registry import Found
from gibench.benchmarks.result_files import FORMAT, RunFolder, key_of
from gibench.benchmarks.scenes import SceneFiles, refuse_files_outside, scene_name, scenes_in
from gibench.benchmarks.settings import Choice, base_settings
from gibench.datasets.errors import MakingError
from gibench.datasets.loading import open_dataset
from gibench.datasets.making import Progress, make
from gibench.rendering.channels import resolve

if TYPE_CHECKING:
    from gibench.benchmarks.on_cluster import Crew

#: What a run's time goes to; the rest of it is the harness.
SPENT = ("scenes", "prepare", "render", "score")


@dataclass
class State:
    """Progress of a run, for whoever watches.

    panoramas: how many of the rooms that light views are there, and of how many. record: of the result that has just
    been written. training: what a training on rooms that has just ended took. remark: something that the user should
    know.
    """

    done: int = 0
    of: int = 0
    failed: int = 0
    record: dict[str, Any] | None = None
    training: dict[str, Any] | None = None
    scenes: Progress | None = None
    panoramas: tuple[int, int] | None = None
    remark: str = ""


@dataclass(frozen=True)
class Report:
    """Result of a run. ids: of all results that were asked for. made, failed: how many now.

    seconds: of all of it, by what they were spent on; "harness" is what is neither scenes, preparing, rendering nor
    scoring. workers: of a cluster, over which preparing and rendering are sums; 0 where there was none.
    """

    ids: tuple[str, ...]
    made: int
    failed: tuple[str, ...]
    seconds: dict[str, float]
    workers: int = 0


class Run:
    """A run over one folder, whose lock is held by `RunFolder.claimed`."""

    def __init__(
        self,
        folder: RunFolder,
        order: Order,
        on_state: Callable[[State], None],
        cluster: Crew | None = None,
    ) -> None:
        """Nothing happens yet. cluster: who does it instead of processes of this one."""
        self.folder, self.order, self.on_state, self.cluster = folder, order, on_state, cluster
        self.state = State()
        self.spent = dict.fromkeys(SPENT, 0.0)
        self.started = time.perf_counter()
        self.began = datetime.now(UTC)
        self.run: dict[str, Any] = {}
        self.before: list[dict[str, Any]] = []
        self.scenes: list[SceneFiles] = []
        self.facts: dict[str, Any] = {}
        self.machine = ""
        self.trainings: dict[tuple[Any, ...], bool] = {}
        self.made: list[str] = []
        self.failed: list[str] = []

    def prepare(self) -> None:
        """Look at the machine, make the scenes, write `run.json`."""
        order = self.order
        self._check_identity()
        if self.cluster is None:
            self.facts = machines.examine(order.variant, order.threads)
        else:
            self.facts = self.cluster.examined(self)
        self.machine = machines.digest(self.facts)
        self._write_run()
        began = time.perf_counter()
        for which in ("reference", "reference-again"):
            self._make(which)
        if any(found.method.channels or found.method.trains for found, _ in order.methods):
            self._make_panoramas()
            self._make("training")
            self._cache_training()
        self.spent["scenes"] += time.perf_counter() - began
        self.scenes = [s for s in scenes_in(*self.folder.references) if s.room < order.room_count]
        for scene in self.scenes:
            refuse_files_outside(self.folder.dataset("reference"), scene)

    def _identity(self) -> dict[str, Any]:
        """Identity that all results of a folder share. Rooms may be added."""
        size, scenes = self.order.size, self.order.scenes
        return {
            "track": self.order.track.id,
            "preset": self.order.preset,
            "warmup": size.warmup,
            "training": self._training_identity(),
            "reference": size.recipe("reference", scenes=scenes).identity(),
        }

    def _training_identity(self) -> dict[str, Any]:
        """Of the views to train on. Panoramas count by what they are made from: they need not be there yet."""
        size = self.order.size
        if size.training is None:
            return {}
        identity = size.recipe("training", scenes=self.order.scenes).identity()
        return identity if size.panoramas is None else {**identity, "panoramas": size.panoramas.model_dump()}

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
            "asked": {},
            **{k: value for k, value in self.run.items() if k in ("created", "equal_time", "runs", "asked")},
            "command": self.order.command,
            "identity": self._identity(),
            "base_settings": {**self.run.get("base_settings", {}), **plans},
            "machine": {**self.facts, "id": self.machine},
            "machines": {**self.run.get("machines", {}), self.machine: self.facts},
        }
        self.before = list(self.run["runs"])
        self.keep_record(ended=False)

    def _make_panoramas(self) -> None:
        """Make the environments of rooms that light views to train on, those that are not there yet."""
        wanted = self.order.size.panoramas
        if wanted is None:
            return
        from gibench.datasets.environment_panoramas import make_environments

        def tell(done: int, of: int) -> None:
            self.state.panoramas = (done, of)
            self.on_state(self.state)

        make_environments(
            self.folder.panoramas,
            count=wanted.count,
            seed=wanted.seed,
            spp=wanted.spp,
            variant=self.facts["variant"],
            on_done=tell,
        )
        self.state.panoramas = None

    def _make(self, which: Any) -> None:
        order = self.order
        own = order.size.training_rooms if which == "training" else None
        rooms = self._rooms_of_scenes() if own is None else own
        panoramas = None if order.size.panoramas is None else self.folder.panoramas
        recipe = order.size.recipe(which, rooms, order.scenes, panoramas)

        def tell(progress: Progress) -> None:
            self.state.scenes = progress
            self.on_state(self.state)

        (self.folder.root / "scenes").mkdir(exist_ok=True)
        make(
            self.folder.dataset(which),
            recipe,
            variant=order.variant,
            cluster=None if self.cluster is None else self.cluster.place,
            command=order.command,
            on_progress=tell,
        )
        self.state.scenes = None

    def _rooms_of_scenes(self) -> int:
        """Number of rooms or scenes: as many as asked for, or as any dataset of them was begun with, since both
        references have to be of the same."""
        from gibench.datasets.manifest import read_manifest

        of_scenes = ["reference", "reference-again"]
        if self.order.size.training_rooms is None:
            of_scenes.append("training")
        begun = [self.folder.dataset(which) for which in of_scenes]
        there = [root for root in begun if (root / "dataset.json").exists()]
        return max([self.order.room_count, *(int(read_manifest(root)["recipe"]["rooms"]) for root in there)])

    def _cache_training(self) -> None:
        """Decode once what trainings read over and over, unless that takes more than half of the disk's room."""
        trained = [found.method for found, _ in self.order.methods if found.method.trains]
        names = resolve([name for method in trained for name in method.channels])
        if not names:
            return
        from gibench.datasets.cache import cache_bytes, make_cache

        root = self.folder.dataset("training")
        if 2 * cache_bytes(open_dataset(root), names) < shutil.disk_usage(root).free:
            make_cache(root, names)

    def jobs(self, methods: Sequence[tuple[Found, Sequence[Choice]]]) -> list[Job]:
        """Every result that is to be there, scene by scene."""
        seeds = self.order.seeds or self.order.size.seeds
        versions = {found.method.id: code_version(found) for found, _ in methods}
        size = self.order.size
        own = {} if size.training_rooms is None else {"rooms": size.training_rooms}
        training = key_of({"recipe": self._identity()["training"], **own})
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
                            "frames": len(scene),
                            "resolution": list(scene.resolution),
                            "warmup": self.order.size.warmup,
                            "training": training if method.channels or method.trains else None,
                            "method": method.id,
                            "knobs": choice.settings,
                            "seed": seed,
                            "code": versions[method.id],
                            "machine": self.machine,
                        }
                        if method.trained or method.trains:
                            config["training_seconds"] = size.budget.training
                        result.append(Job(found, choice, scene, seed, config, key_of(config)))
        return result

    def do(self, jobs: Sequence[Job]) -> None:
        """Make the results that are not there. Raises RunError for a full disk.

        All stand as asked for now, so that they come before results of other code that were made since.
        """
        began = self.began.isoformat(timespec="seconds")
        self.run["asked"] |= {job.id: began for job in jobs}
        self.keep_record(ended=False)
        waiting = [job for job in jobs if not self._is_there(job)]
        self.state.of += len(jobs)
        self.state.done += len(jobs) - len(waiting)
        self.state.record = None
        self.on_state(self.state)
        groups: dict[tuple[Any, ...], list[Job]] = {}
        for job in waiting:
            baked = job.found.method.baked_settings(job.choice.settings)
            groups.setdefault((job.scene.name, job.found.method.id, job.seed, repr(baked)), []).append(job)
        if self.cluster is None:
            for group in groups.values():
                if self._is_trained(group[0], jobs):
                    while group:
                        group = group[self._serve(group) :]
                else:
                    self._leave_out(group)
        else:
            firsts = [g[0] for g in groups.values() if self._is_to_be_trained(g[0], jobs)]
            self.cluster.train(self, list({key_of_training(job): job for job in firsts}.values()))
            ready = []
            for group in groups.values():
                if self.trainings.get(key_of_training(group[0]), True):
                    ready.append(group)
                else:
                    self._leave_out(group)
            self.cluster.serve(self, ready)

    def _leave_out(self, group: Sequence[Job]) -> None:
        self.state.done += sum(job.id not in self.failed for job in group)

    def remark(self, text: str) -> None:
        """Tell something that the user should know."""
        self.state.remark = text
        self.on_state(self.state)
        self.state.remark = ""

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

    def _is_trained(self, job: Job, jobs: Sequence[Job]) -> bool:
        """Train on rooms what a result needs; whether it is there now.

        A training that failed is told once, by the first result that would have used it; the others are not tried.
        """
        if self._is_to_be_trained(job, jobs):
            self.trained(
                job,
                serving.train(self.task([job], None), job, self.facts, self.limits, self.keep, self.spend),
            )
        return self.trainings.get(key_of_training(job), True)

    def _is_to_be_trained(self, job: Job, jobs: Sequence[Job]) -> bool:
        """Whether a result needs a training on rooms that was tried neither by this command nor, in vain, before."""
        if not (job.found.method.trains and self.order.track.prepare_on == "rooms"):
            return False
        key = key_of_training(job)
        if key in self.trainings:
            return False
        alike = [one for one in jobs if key_of_training(one) == key]
        if any(self._failed_in_training(one) for one in alike):
            self.trainings[key] = False
        return key not in self.trainings

    def trained(self, job: Job, took: dict[str, Any] | None) -> None:
        """Take note of a training that results need. took: its times; None where it failed."""
        self.trainings[key_of_training(job)] = took is not None
        if took is not None:
            self.state.training = took
            self.on_state(self.state)
            self.state.training = None

    def _failed_in_training(self, job: Job) -> bool:
        path = self.folder.result_file(job.id)
        return path.exists() and self.folder.read_result(job.id).get("phase") == "train"

    def task(self, group: Sequence[Job], scene: SceneFiles | None) -> worker.Task:
        """The task of the process that makes results of one preparation; without a scene it trains."""
        first, order = group[0], self.order
        self.folder.logs.mkdir(exist_ok=True)
        method = first.found.method
        on_rooms = order.track.prepare_on == "rooms"
        return worker.Task(
            method=method,
            seed=first.seed,
            scene=scene,
            settings=tuple((job.choice.settings, self.folder.partial(job.id)) for job in group),
            training=self.folder.dataset("training") if method.channels or method.trains else None,
            rooms=self.folder.bakes("rooms") if on_rooms else None,
            site=self.folder.site(first.scene.name),
            bakes=self.folder.bakes(first.scene.name),
            machine={"machine": self.machine},
            seconds=order.size.budget.training,
            parts=order.track.parts,
            warmup=order.size.warmup,
            variant=self.facts["variant"],
            threads=self.facts["threads"],
            log=self.folder.logs / f"{first.id}.log",
        )

    def _serve(self, group: list[Job]) -> int:
        """Start a process for some results of one preparation; returns how many are there now, at least one."""
        task = self.task(group, group[0].scene)
        return serving.serve(task, group, self.facts, self.limits, self.keep, self.spend)

    @property
    def limits(self) -> serving.Limits:
        """Seconds that the processes may take."""
        budget = self.order.size.budget
        return serving.Limits(budget.prepare, budget.render)

    def spend(self, what: str, seconds: float) -> None:
        """Book seconds under one of `SPENT`."""
        self.spent[what] += seconds

    def keep(self, record: dict[str, Any], partial: Path | None = None) -> None:
        """Write a result and tell of it. partial: see `RunFolder.write_result`."""
        self.folder.write_result(record, partial)
        (self.made if record["status"] == "ok" else self.failed).append(record["id"])
        self.state.done += 1
        self.state.failed = len(self.failed)
        self.state.record = record
        self.on_state(self.state)
        self.state.record = None

    def finish(self, ids: Sequence[str]) -> Report:
        """Write down what was done and what it took."""
        seconds = self.keep_record(ended=True)
        workers = 0 if self.cluster is None else self.cluster.workers
        return Report(tuple(ids), len(self.made), tuple(self.failed), seconds, workers)

    def keep_record(self, *, ended: bool) -> dict[str, float]:
        """Write down what this command has done so far, and return its seconds. A killed one leaves that it began."""
        total = time.perf_counter() - self.started
        seconds = {"total": total, **self.spent, "harness": max(0.0, total - sum(self.spent.values()))}
        if not self.facts:
            return seconds
        record = {
            "command": self.order.command,
            "began": self.began.isoformat(timespec="seconds"),
            "ended": ended,
            "machine": self.machine,
            **({} if self.cluster is None else {"workers": self.cluster.workers}),
            "made": len(self.made),
            "failed": len(self.failed),
            "seconds": seconds,
        }
        self.run["runs"] = [*self.before, record]
        self.folder.write_run(self.run)
        return seconds


def key_of_training(job: Job) -> tuple[Any, ...]:
    """What results that use the same training on rooms have in common."""
    knobs = job.found.method.trained_settings(job.choice.settings)
    return job.found.method.id, job.seed, repr(knobs), str(job.config["code"])


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

    Raises FolderError, ResultsError, TrackError, MethodError, ClusterError before anything is made; RunError,
    MakingError and Interrupted half-way, when the same call continues.
    """
    # Workers of a cluster start in folders of their own.
    folder = RunFolder(root if order.cluster is None else Path(os.path.abspath(root)))
    with folder.claimed(), _crew(order) as crew:
        doing = Run(folder, order, on_state, crew)
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
            with suppress(OSError):
                doing.keep_record(ended=False)
            done = f"{doing.state.done} of {doing.state.of} results" if doing.state.of else "no result"
            again = f"to continue run `{order.command}`" if order.command else "the same call continues"
            raise Interrupted(f"stopped with {done} there; {again}") from None
        except MakingError:
            with suppress(OSError):
                doing.keep_record(ended=False)
            raise
        except OSError as problem:
            with suppress(OSError):
                doing.keep_record(ended=False)
            raise RunError(_why(root, problem)) from None


@contextmanager
def _crew(order: Order) -> Iterator[Crew | None]:
    if order.cluster is None:
        yield None
        return
    from gibench.benchmarks.on_cluster import Crew
    from gibench.datasets.cluster_opening import opened

    with opened(order.cluster) as place:
        yield Crew(place)


def _why(root: Path, problem: OSError) -> str:
    if problem.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"{root}: the disk is full: free some space, then run the same command again to continue"
    return f"{problem.filename or root}: {problem.strerror}"


def failures(root: Path) -> list[tuple[str, str]]:
    """Failed results of a folder: (label, reason)."""
    folder = RunFolder(root)
    records = (folder.read_result(id) for id in folder.ids())
    return [
        (f"{scene_name(r['room'])} {r['label']}", r["reason"]) for r in records if r["status"] == "failed"
    ]
