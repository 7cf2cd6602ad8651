"""Equal time: the most expensive setting of each method that meets a given time per frame on this machine.

What is tried along the way are ordinary results over the whole path of every scene, so nothing is measured twice and
nothing is extrapolated.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable
from typing import Any

from gibench.baselines.method import Method, Setting
from gibench.benchmarks.outcomes import Job
from gibench.benchmarks.registry import Found
from gibench.benchmarks.running import Run
from gibench.benchmarks.settings import Choice, label


def last_within(values: tuple[Setting, ...], limit: float, measure: Callable[[Setting], float]) -> int:
    """Index of the last of `values`, cheapest first, whose measure is at most `limit`; −1 where none is.

    Bisection: measures at most ⌈log₂(n + 1)⌉ of them, and both sides of the limit.
    """
    fits, exceeds = -1, len(values)
    while exceeds - fits > 1:
        middle = (fits + exceeds) // 2
        if measure(values[middle]) <= limit:
            fits = middle
        else:
            exceeds = middle
    return fits


def search(run: Run, milliseconds: float) -> list[Job]:
    """Find the settings for all methods of a run, and write down what was measured.

    A method without a budget knob runs at its first setting, and it is recorded whether that meets the time. Returns
    the results of what was found. `run.json` gains an entry a method under "equal_time": ms, method, machine, knob,
    value and label (None where even the cheapest setting takes longer), measured_ms, and all that was tried, value →
    ms (None where it failed).
    """
    found_jobs = []
    for found, chosen in run.order.methods:
        entry, jobs = _searched(run, milliseconds, found, chosen[0])
        same = ("ms", "method", "machine")
        others = [e for e in run.run["equal_time"] if any(e[key] != entry[key] for key in same)]
        run.run["equal_time"] = [*others, entry]
        run.folder.write_run(run.run)
        found_jobs += jobs
    return found_jobs


def _searched(run: Run, limit: float, found: Found, base: Choice) -> tuple[dict[str, Any], list[Job]]:
    method = found.method
    values = _values(method, base)
    tried: dict[Setting, tuple[float, list[Job], Choice]] = {}

    def measure(value: Setting) -> float:
        settings = base.settings if method.budget is None else {**base.settings, method.budget: value}
        choice = Choice(tuple(settings.items()), label(method, settings, run.order.size.plan(method)))
        jobs = run.jobs([(found, [choice])])
        run.do(jobs)
        tried[value] = (_mean_of_medians(run, jobs), jobs, choice)
        return tried[value][0]

    index = last_within(values, limit, measure)
    entry: dict[str, Any] = {
        "ms": limit,
        "method": method.id,
        "machine": run.machine,
        "knob": method.budget,
        "value": None,
        "label": None,
        "measured_ms": None,
        "tried": {str(value): ms if ms < float("inf") else None for value, (ms, _, _) in tried.items()},
    }
    if index < 0:
        return entry, []
    ms, jobs, choice = tried[values[index]]
    return entry | {
        "value": values[index] if method.budget is not None else None,
        "label": choice.label,
        "measured_ms": ms,
    }, jobs


def _values(method: Method, base: Choice) -> tuple[Setting, ...]:
    for knob in method.knobs:
        if knob.name == method.budget:
            return knob.values
    return ("",)  # the one setting there is


def _mean_of_medians(run: Run, jobs: list[Job]) -> float:
    """Milliseconds a frame: the median over the path, the mean over scenes; infinite where a result failed."""
    medians = []
    for job in jobs:
        if not run.folder.result_file(job.id).exists():  # its training failed, which another record tells
            return float("inf")
        record = run.folder.read_result(job.id)
        if record["status"] != "ok":
            return float("inf")
        medians.append(statistics.median(frame["seconds"] for frame in record["frames"]) * 1000)
    return statistics.fmean(medians)
