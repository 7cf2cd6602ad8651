"""A run on a cluster: trainings and results as tasks of workers, each watched there as a local run watches them.

Times compare on one kind of machine alone, so one kind does all trainings and results of a command; the others make
rooms. Workers send the records; the process that holds the folder writes them, as it does with its own.
"""

from __future__ import annotations

import json
import platform
import secrets
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gibench.benchmarks import machine as machines
from gibench.benchmarks import outcomes, serving, turns, worker
from gibench.benchmarks.code_version import code_version
from gibench.benchmarks.errors import RunError
from gibench.benchmarks.outcomes import Job
from gibench.benchmarks.registry import Found
from gibench.benchmarks.result_files import RunFolder, remove_frames
from gibench.datasets.cluster import facts_of_workers, run_tasks
from gibench.datasets.cluster_workers import Elsewhere, still_wanted
from gibench.datasets.files import as_json
from gibench.datasets.pool import Listener, Report, Work

if TYPE_CHECKING:
    from gibench.benchmarks.running import Run

#: Seconds that a worker may wait for its turn beside those that the others on its machine may take.
PATIENCE = 60.0


class Crew:
    """The workers that do a run. place: see `gibench.datasets.cluster_opening.opened`."""

    def __init__(self, place: str) -> None:
        """Nothing happens yet."""
        self.place = place
        self.setup: Measuring | None = None
        self.hosts: Counter[str] = Counter()

    def examined(self, run: Run) -> dict[str, Any]:
        """Facts about the machines that will measure; makes all workers ready. Raises ClusterError.

        They are those of the last command where such are there, else of a kind that has results, else the most.
        """
        order = run.order
        found = [found for found, _ in order.methods]
        self.setup = Measuring(order.variant, 1, tuple((one, code_version(one)) for one in found))
        answers = facts_of_workers(self.setup, cluster=self.place, root=run.folder.root)
        kinds: dict[str, list[tuple[str, dict[str, Any]]]] = {}
        for host, facts in answers.values():
            kinds.setdefault(machines.digest(facts), []).append((host, facts))
        last, before = run.run.get("machine", {}).get("id"), run.run.get("machines", {})
        chosen = max(kinds, key=lambda kind: (kind == last, kind in before, len(kinds[kind]), kind))
        for kind, members in kinds.items():
            if kind != chosen:
                facts = members[0][1]
                what = f"{facts['cpu']}, {facts['threads']} threads" + (
                    f", {facts['gpu']}" * bool(facts["gpu"])
                )
                run.remark(f"{len(members)} workers make rooms only, as they are other machines ({what})")
        self.hosts = Counter(host for host, _ in answers.values())
        return kinds[chosen][0][1]

    @property
    def workers(self) -> int:
        """How many there are."""
        return sum(self.hosts.values())

    def train(self, run: Run, jobs: Sequence[Job]) -> None:
        """Train on rooms what some results need."""
        tasks = [Training(run.task([job], None), job, self._limits(run)) for job in jobs]
        self._do(run, tasks, lambda number, took: run.trained(jobs[number], took))

    def serve(self, run: Run, groups: Sequence[Sequence[Job]]) -> None:
        """Make results; each group is of one preparation."""
        # Those of a scene share bakes: neighbours in the queue, which run at the same time, are of several scenes.
        counts: Counter[str] = Counter()
        turn = {}
        for number, group in enumerate(groups):
            turn[number] = counts[group[0].scene.name]
            counts[group[0].scene.name] += 1
        tasks = [
            Results(
                run.task(groups[number], groups[number][0].scene), tuple(groups[number]), self._limits(run)
            )
            for number in sorted(turn, key=lambda number: (turn[number], number))
        ]
        self._do(run, tasks, lambda number, content: None)

    def _limits(self, run: Run) -> serving.Limits:
        limits, others = run.limits, max(self.hosts.values())
        return replace(
            limits, wait=PATIENCE + others * (serving.STARTUP_SECONDS + limits.prepare + limits.render)
        )

    def _do(self, run: Run, tasks: Sequence[Results | Training], done: Callable[[int, Any], None]) -> None:
        def message(number: int, kind: str, content: Any) -> None:
            if kind == "spent":
                run.spend(*content)
                return
            record, partial = json.loads(content["record"]), Path(content["partial"])
            if record["id"] in run.made or record["id"] in run.failed:  # of an attempt before this one
                remove_frames(partial)
                return
            if record.get("prepare"):
                record["prepare"]["beside"] = self.hosts[content["host"]] - 1
            run.keep(record, partial)

        def ended(number: int, content: Any) -> None:
            if not (isinstance(content, dict) and "rejected" in content):
                done(number, content)
                return
            task = tasks[number]
            why = {"reason": content["rejected"], "traceback": ""}
            for job in task.jobs:
                if job.id not in run.made and job.id not in run.failed:
                    run.keep(outcomes.bad(job, run.facts, task.phase, why, None, task.task.log))
            done(number, None)

        assert self.setup is not None
        run_tasks(
            Work(self.setup, Queue(tuple(tasks)), lambda number: tasks[number].name),
            range(len(tasks)),
            Listener(lambda facts: None, message, ended, lambda number: None),
            cluster=self.place,
            root=run.folder.root,
            accepts=lambda facts: machines.digest(facts) == run.machine,
        )


# ---- in the workers


@dataclass(frozen=True)
class Measuring:
    """Makes a worker ready to measure; it answers what its machine is.

    methods: with the version of their code that the results are to be of. Raises RunError where it is another.
    """

    variant: str
    threads: int
    methods: tuple[tuple[Found, dict[str, Any]], ...]

    def __call__(self) -> dict[str, Any]:
        """See `machine.examine`."""
        facts = _examined(self.variant, self.threads)
        for found, asked in self.methods:
            there = code_version(found)
            differing = [
                f"{key}: {there[key]} there, {asked[key]} here" for key in asked if there[key] != asked[key]
            ]
            if differing:
                raise RunError(
                    f"method '{found.method.id}' is another there ({'; '.join(differing)}): install the same"
                )
        return facts


#: What this process of a worker knows of its machine, by variant and threads.
_known: dict[tuple[str, int], dict[str, Any]] = {}


def _examined(variant: str, threads: int) -> dict[str, Any]:
    if (variant, threads) not in _known:
        facts = machines.examine(variant, threads)
        _known[variant, threads] = _known[facts["variant"], threads] = facts
    return _known[variant, threads]


def _machine_of(task: worker.Task) -> dict[str, Any]:
    """Facts about this machine, which must be of the kind that a task is for. Raises Elsewhere."""
    from distributed import get_worker

    facts = _examined(task.variant, get_worker().state.nthreads)
    if machines.digest(facts) != task.machine["machine"]:
        raise Elsewhere(f"{get_worker().address} is another machine")
    return facts


@dataclass(frozen=True)
class Queue:
    """All tasks, of which a worker is sent its own."""

    tasks: tuple[Results | Training, ...]

    def of(self, number: int) -> Results | Training:
        """One of them."""
        return self.tasks[number]

    def __call__(self, number: int, report: Report) -> Any:
        """Do one of them."""
        return self.tasks[number](number, report)


@dataclass(frozen=True)
class Results:
    """Makes the results of one preparation. task: as a local run would do it."""

    task: worker.Task
    jobs: tuple[Job, ...]
    limits: serving.Limits
    phase = "start"

    @property
    def name(self) -> str:
        """For the dashboard."""
        return f"{self.jobs[0].found.method.id} {self.jobs[0].scene.name}"

    def __call__(self, number: int, report: Report) -> None:
        """Make those that are not there."""
        machine = _machine_of(self.task)
        root = self.task.settings[0][1].parents[1]
        left = [job for job in self.jobs if not RunFolder(root).result_file(job.id).exists()]
        places = {job.id: root / "results" / f".{job.id}.partial-{secrets.randbelow(10**15)}" for job in left}
        handed: set[str] = set()

        def keep(record: dict[str, Any]) -> None:
            report("record", _sent(record, places[record["id"]]))
            handed.add(record["id"])

        try:
            while left:
                settings = tuple((job.choice.settings, places[job.id]) for job in left)
                task = replace(self.task, settings=settings, turn=turns.turn_file())
                made = serving.serve(
                    task, left, machine, self.limits, keep, _spend(report), lambda: still_wanted(report)
                )
                left = left[made:]
        finally:
            for id in places.keys() - handed:
                remove_frames(places[id])


@dataclass(frozen=True)
class Training:
    """Trains on rooms what a result needs; gives what it took, None where it failed."""

    task: worker.Task
    job: Job
    limits: serving.Limits
    phase = "train"

    @property
    def name(self) -> str:
        """For the dashboard."""
        return f"training of {self.job.found.method.id}, seed {self.job.seed}"

    @property
    def jobs(self) -> tuple[Job, ...]:
        """The result that tells of it where it fails."""
        return (self.job,)

    def __call__(self, number: int, report: Report) -> dict[str, Any] | None:
        """Train."""
        task = replace(self.task, turn=turns.turn_file())
        took = serving.train(
            task,
            self.job,
            _machine_of(task),
            self.limits,
            lambda record: report("record", _sent(record, task.settings[0][1])),
            _spend(report),
            lambda: still_wanted(report),
        )
        return None if took is None else dict(json.loads(as_json(took)))


def _sent(record: dict[str, Any], partial: Path) -> dict[str, Any]:
    # Dask sends plain types alone.
    return {"record": as_json(record).decode(), "partial": str(partial), "host": platform.node()}


def _spend(report: Report) -> serving.Spend:
    return lambda what, seconds: report("spent", (what, float(seconds)))
