"""The trainings of a run, each once, with their curves of held-out error and the names that readers are told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gibench.benchmarks.report.source import ReportSource
from gibench.benchmarks.report.summary import Summary

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class TrainingCurve:
    """The held-out error of one training, by the method's own measure in its own space.

    track, machine: of the results that use it. family: the method without the name of an ablation: errors are
    comparable within it. method: whose colour it has. name: its setting. scenes: that use it, more than one where a
    method trains on other rooms. steps, seconds, errors, kept: (N,), a look each; an error that was not finite is NaN;
    kept: whether the weights are those of this look.
    """

    track: str
    machine: str
    family: str
    method: str
    name: str
    scenes: tuple[str, ...]
    seed: int
    steps: NDArray[np.int64]
    seconds: NDArray[np.float64]
    errors: NDArray[np.float64]
    kept: NDArray[np.bool_]

    @property
    def best(self) -> int | None:
        """Number of the look whose weights were kept.

        That with the smallest error, the earliest of equal ones, where the training does not say; None where none was
        finite.
        """
        finite = np.isfinite(self.errors)
        if (self.kept & finite).any():
            return int(np.argmax(self.kept & finite))
        return int(np.argmin(np.where(finite, self.errors, np.inf))) if finite.any() else None


def family_of(method: str) -> str:
    """A method without the name of an ablation: elp of elp:no-lpips."""
    return method.partition(":")[0]


def trainings(source: ReportSource, summary: Summary) -> list[TrainingCurve]:
    """Give each training once, however many results use it, in the order of methods, settings, scenes and seeds."""
    rows = source.curves.merge(summary.results, on="result")
    if rows.empty:
        return []
    found: dict[tuple[Any, ...], list[pd.DataFrame]] = {}
    for _, looks in rows.groupby(["result", "training"], sort=False):
        # Clock times tell trainings apart: curves that agree in every look to the last bit are one training.
        numbers = looks[["step", "seconds", "error"]].to_numpy(np.float64)
        first = looks.iloc[0]
        who = (first["track"], first["machine"], family_of(first["method"]))
        key = (*who, int(first["training"]), numbers.tobytes())
        found.setdefault(key, []).append(looks)
    users = [{int(looks["entry"].iloc[0]) for looks in uses} for uses in found.values()]
    names = _names(summary, users)
    several = {key[:3] for key in found if key[3] > 0}
    curves = []
    for (key, uses), entries in zip(found.items(), users, strict=True):
        track, machine, family, number, _ = key
        looks, name = uses[0], names[min(entries)]
        curve = TrainingCurve(
            track=track,
            machine=machine,
            family=family,
            method=str(summary.entries.loc[min(entries), "method"]),
            name=f"{name}, training {number + 1}" if key[:3] in several else name,
            scenes=tuple(sorted({str(one["scene"].iloc[0]) for one in uses})),
            seed=int(looks["seed"].iloc[0]),
            steps=looks["step"].to_numpy(np.int64),
            seconds=looks["seconds"].to_numpy(np.float64),
            errors=looks["error"].where(np.isfinite(looks["error"])).to_numpy(np.float64),
            kept=looks["kept"].to_numpy(np.bool_),
        )
        curves.append((min(entries), number, curve))
    curves.sort(key=lambda one: (one[0], one[1], one[2].scenes, one[2].seed))
    return [curve for *_, curve in curves]


def _names(summary: Summary, users: list[set[int]]) -> dict[int, str]:
    """Name of the training of each entry: entries that share one in some room share its name."""
    groups: list[set[int]] = []
    for own in users:
        joined = own.union(*(group for group in groups if group & own))
        groups = [*(group for group in groups if not group & own), joined]
    names: dict[int, str] = {}
    for group in groups:
        of = summary.entries.loc[sorted(group)]
        labels, curves = of["label"].unique(), of["curve"].unique()
        method = family_of(str(of["method"].iloc[0]))
        name = curves[0] if len(curves) == 1 else f"{method}, {len(labels)} settings"
        names |= dict.fromkeys(group, str(labels[0] if len(labels) == 1 else name))
    return names
