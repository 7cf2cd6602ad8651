"""Watching the process that makes results, or that trains: on this machine, or in a worker of a cluster."""

from __future__ import annotations

import errno
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from gibench.benchmarks import outcomes, worker
from gibench.benchmarks.outcomes import Job
from gibench.benchmarks.processes import Process

#: Seconds that a process may take until renderer and scene are loaded.
STARTUP_SECONDS = 600.0

#: Tells what of a run's time something took: "prepare" or "render", and seconds.
Spend = Callable[[str, float], None]

#: Takes the record of a result.
Keep = Callable[[dict[str, Any]], None]


@dataclass(frozen=True)
class Limits:
    """Seconds for a preparation, for the frames of a result, and for waiting until nobody else uses the machine."""

    prepare: float
    render: float
    wait: float = 0.0


def serve(
    task: worker.Task,
    jobs: Sequence[Job],
    machine: dict[str, Any],
    limits: Limits,
    keep: Keep,
    spend: Spend,
    wanted: Callable[[], bool] = lambda: True,
) -> int:
    """Start a process for some results of one preparation; returns how many are there now, at least one.

    machine: facts about the one that this runs on. wanted: whether to go on. Raises OSError for a full disk, and
    `processes.Unwanted`.
    """
    seconds = {
        "start": STARTUP_SECONDS + limits.wait,
        "prepare": limits.prepare,
        "wait": limits.wait,
        "render": limits.render,
    }
    with Process(task, wanted) as process:
        served, prepared = 0, None
        phase, clock = "start", time.perf_counter()
        while True:
            kind, content = process.message(seconds[phase])
            spent = time.perf_counter() - clock
            clock = time.perf_counter()
            if kind == "ready":
                phase = "prepare"
            elif kind == "prepared":
                spend("prepare", content["wall_seconds"])
                prepared, phase = content, "render"
            elif kind == "waits":
                phase = "wait"
            elif kind == "alone":
                phase = "render"
            elif kind == "result":
                spend("render", content["warmup_seconds"] + sum(f["seconds"] for f in content["frames"]))
                keep(outcomes.good(jobs[served], machine, prepared or {}, content))
                served += 1
            elif kind == "done":
                task.log.unlink(missing_ok=True)
                return served
            elif kind == "storage":
                raise OSError(errno.ENOSPC, "the disk is full", content)
            else:  # failed, died or too late
                phase = "render" if phase == "wait" else phase
                if phase != "start":
                    spend(phase, spent)
                # A preparation that fails, fails for all settings that it was for.
                lost = jobs[served : served + 1] if phase == "render" else jobs
                for job in lost:
                    keep(outcomes.bad(job, machine, phase, content, prepared, task.log))
                return served + len(lost)


def train(
    task: worker.Task,
    job: Job,
    machine: dict[str, Any],
    limits: Limits,
    keep: Keep,
    spend: Spend,
    wanted: Callable[[], bool] = lambda: True,
) -> dict[str, Any] | None:
    """Start a process that trains on rooms; what it took, or None where it failed, which the record of `job` says."""
    with Process(task, wanted) as process:
        clock = time.perf_counter()
        kind, content = process.message(STARTUP_SECONDS + limits.wait)
        if kind == "ready":
            kind, content = process.message(limits.prepare)
        spend("prepare", time.perf_counter() - clock)
    if kind == "trained":
        task.log.unlink(missing_ok=True)
        return {"method": job.found.method.id, "seed": job.seed, **content}
    if kind == "storage":
        raise OSError(errno.ENOSPC, "the disk is full", content)
    keep(outcomes.bad(job, machine, "train", content, None, task.log))
    return None
