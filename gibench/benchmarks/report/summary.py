"""Results brought together by setting: means over rooms with their intervals, differences, noise floors."""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from gibench.benchmarks.report.source import PREPARATION, ReportError, ReportSource
from gibench.benchmarks.statistics import verdict
from gibench.metrics import METRICS, mean_interval, paired_difference

if TYPE_CHECKING:
    import pandas as pd

ENTRY = ["track", "label", "machine"]
"""Key of a row of the leaderboard. Times of two machines never share a row."""

COSTS = ["ms_median", "ms_p95", "prepare_s", *(f"prepare_{name}_s" for name in PREPARATION), "bytes"]


@dataclass(frozen=True, eq=False)
class Summary:
    """A run by setting.

    entries: a row a setting (track, label, machine), indexed by its number; columns method, title, family, knobs,
    curve, rooms (how many have results of all seeds) and failed_rooms (how many lack one that failed), seeds, `COSTS`
    (means over rooms) and peak_mb (the largest).
    results: the run's results with their `entry`.
    values: metric by entry, scene, frame, part, seeds averaged; frame is -1 for metrics in time.
    scores: a row by entry, part and metric: mean, low and high (95 %, over rooms and seeds), rooms, frames, left_out
    (frames without a finite value), floor (of the reference), difference, difference_low and difference_high against
    the chosen setting on the frames that both have, and verdict: what may be said of that difference
    (`gibench.benchmarks.statistics.verdict`).
    floor: values of the reference's floor by scene, frame, part and metric, frame -1 for metrics in time.
    paths: the sequence of each scene and frame, "" for a still.
    against: the label that differences are taken against, None for none.
    unbiased: metrics that are against the truth (`gibench.benchmarks.results.Results.unbiased`).
    """

    entries: pd.DataFrame
    results: pd.DataFrame
    values: pd.DataFrame
    scores: pd.DataFrame
    floor: pd.DataFrame
    paths: pd.DataFrame
    against: str | None
    unbiased: tuple[str, ...]

    @property
    def machines(self) -> list[str]:
        """The machines that results come from, in their order."""
        return list(self.entries["machine"].unique())

    @property
    def tracks(self) -> list[str]:
        """The tracks that results are of, in their order."""
        return list(self.entries["track"].unique())

    def points(self, track: str, part: str, metric: str, machine: str | None = None) -> pd.DataFrame:
        """The finite scores of a track by entry, beside the columns of `entries`; `rooms` is that of the scores.

        machine: whose; None for all. Intervals of one frame in one room are NaN: their ends lie at infinity.
        """
        scores = self.scores[(self.scores["part"] == part) & (self.scores["metric"] == metric)]
        entries = self.entries[self.entries["track"] == track]
        if machine is not None:
            entries = entries[entries["machine"] == machine]
        points = (
            entries.drop(columns="rooms").merge(scores, left_index=True, right_on="entry").set_index("entry")
        )
        points[["low", "high"]] = points[["low", "high"]].replace([-np.inf, np.inf], np.nan)
        return points[np.isfinite(points["mean"])]

    def metrics(self, part: str, *, in_time: bool | None = None) -> list[str]:
        """Metrics that were computed on a part, in the order of the registry."""
        found = set(self.scores.loc[self.scores["part"] == part, "metric"])
        return [
            name
            for name, descriptor in METRICS.items()
            if name in found and (in_time is None or in_time == (descriptor.inputs == "sequence"))
        ]

    @property
    def parts(self) -> list[str]:
        """The parts that were scored, the full image first."""
        return sorted(self.scores["part"].unique())


def summarise(source: ReportSource, *, against: str | None = None) -> Summary:
    """Bring a run's results together.

    against: a label or the id of a method that differences are taken against.

    Raises:
        ReportError: for a run without results, or an `against` that is not there (with the nearest names).
    """
    import pandas as pd

    results = source.results.reset_index(drop=True).copy()
    if results.empty:
        raise ReportError(f"{source.root}: no results to report; gibench bench run makes them")
    results["machine"] = results["machine"].fillna("").astype(str)
    results["entry"] = results.groupby(ENTRY, sort=False).ngroup()
    if source.frames.empty and (results["status"] == "ok").any():
        raise ReportError(f"{source.root}: its results are not scored; gibench bench score does that")
    chosen = None if against is None else _label(results, against)
    results["machine"] = results["machine"].map(machine_names(source.run, list(results["machine"].unique())))
    by_seed = _by_seed(source, results)
    values = _values(by_seed)
    by_frame = _with_time(source.floor).groupby(["scene", "frame", "part", "metric"])["value"]
    floor = by_frame.mean().reset_index()
    entries = _entries(results)
    unbiased = tuple(source.run.get("unbiased", ()))
    scores = pd.DataFrame(_scores(entries, by_seed, floor, chosen, unbiased), columns=_SCORE_COLUMNS)
    return Summary(entries, results, values, scores, floor, source.paths, chosen, unbiased)


def machine_names(run: Mapping[str, Any], ids: Sequence[str]) -> dict[str, str]:
    """Name machines by what they are, and tell those of one make apart by their id."""
    facts = run.get("machines") or {}
    if len(ids) == 1 and ids[0] not in facts:
        facts = {ids[0]: run.get("machine") or {}}
    names = {}
    for id in ids:
        known = facts.get(id) or {}
        words = [str(known[name]) for name in ("cpu", "gpu") if known.get(name)]
        if known.get("threads"):
            words.append(f"{known['threads']} threads")
        names[id] = ", ".join(words) or id or "a machine that is not named"
    repeated = len(set(names.values())) < len(names)
    return {id: f"{name} ({id[:6]})" if repeated else name for id, name in names.items()}


_SCORE_COLUMNS = [
    *("entry", "part", "metric", "mean", "low", "high", "rooms", "frames", "left_out", "floor"),
    *("difference", "difference_low", "difference_high", "verdict"),
]


def _label(results: pd.DataFrame, against: str) -> str:
    labels = list(results["label"].unique())
    if against in labels:
        return against
    of_method = list(results.loc[results["method"] == against, "label"].unique())
    if len(of_method) == 1:
        return of_method[0]
    if of_method:
        raise ReportError(f"{against} has several settings; choose one of: {', '.join(of_method)}")
    near = difflib.get_close_matches(against, labels, n=3, cutoff=0.4) or sorted(labels)
    raise ReportError(f"no result is labelled '{against}'; the nearest are: {', '.join(near)}")


def _with_time(table: pd.DataFrame) -> pd.DataFrame:
    # A metric in time belongs to no frame: -1 says so, where a table has no such column or no number in it.
    frame = table["frame"].fillna(-1).astype(int) if "frame" in table else -1
    return table.assign(frame=frame)


def _by_seed(source: ReportSource, results: pd.DataFrame) -> pd.DataFrame:
    """A row by entry, scene, frame, part, metric and seed."""
    import pandas as pd

    columns = ["result", "frame", "metric", "part", "value"]
    tables = [source.frames[columns], _with_time(source.sequences)[columns]]
    rows = pd.concat([table for table in tables if not table.empty] or tables[:1])
    rows = rows[rows["metric"].isin(list(METRICS))].astype({"value": float, "frame": int})
    done = results.loc[results["status"] == "ok", ["result", "entry", "scene", "seed"]]
    return rows.merge(done, on="result").drop(columns="result")


def _values(by_seed: pd.DataFrame) -> pd.DataFrame:
    keys = ["entry", "scene", "frame", "part", "metric"]
    joined = by_seed.assign(lost=~np.isfinite(by_seed["value"]))
    means = joined.groupby(keys, as_index=False).agg(value=("value", "mean"), lost=("lost", "any"))
    # One seed without a number leaves the frame without one, where it will be counted.
    return means.assign(value=means["value"].where(~means["lost"])).drop(columns="lost")


def _entries(results: pd.DataFrame) -> pd.DataFrame:
    import pandas as pd

    rows: list[dict[str, Any]] = []
    for _, group in results.groupby("entry", sort=True):
        first, done = group.iloc[0], group[group["status"] == "ok"]
        row = {name: first[name] for name in [*ENTRY, "method", "title", "family", "knobs"]}
        # Means are over frames that all seeds have.
        whole = done.groupby("scene")["seed"].nunique() == group["seed"].nunique()
        rooms = set(whole.index[whole])
        row["rooms"] = len(rooms)
        row["failed_rooms"] = len(set(group.loc[group["status"] != "ok", "scene"]) - rooms)
        row["seeds"] = done["seed"].nunique()
        for name in COSTS:
            # Every room weighs the same, however many seeds it has.
            row[name] = float(done.groupby("scene")[name].mean().mean()) if len(done) else math.nan
        row["peak_mb"] = float(done["peak_mb"].max()) if len(done) else math.nan
        rows.append(row)
    entries = pd.DataFrame(rows)
    entries["curve"], entries["step"] = _curves(entries)
    return entries


def _curves(entries: pd.DataFrame) -> tuple[list[str], list[str]]:
    """Name the curve that each setting lies on, and what tells it from the others on that curve.

    A curve joins settings of one method that differ in one number: the one that takes most values.
    """
    knobs = [knobs_of(text) for text in entries["knobs"]]
    curves, steps = [], []
    for position, (method, own) in enumerate(zip(entries["method"], knobs, strict=True)):
        siblings = [k for k, other in zip(knobs, entries["method"], strict=True) if other == method]
        counts = {
            name: len({json.dumps(other.get(name)) for other in siblings})
            for name, value in own.items()
            if is_number(value)
        }
        turned = max(counts, key=lambda name: counts[name]) if counts and max(counts.values()) > 1 else None
        label = str(entries["label"].iloc[position])
        if turned is None:
            curves.append(label)
            steps.append("")
            continue
        curves.append(label_without(label, turned))
        steps.append(f"{own[turned]:g} {turned}" if turned == "spp" else f"{turned}={own[turned]:g}")
    return curves, steps


def label_without(label: str, knob: str) -> str:
    """What a label says beside one knob."""
    return " ".join(word for word in label.split() if not word.startswith(f"{knob}="))


def is_number(value: Any) -> bool:
    """Whether a knob's value is a number that can be turned up and down."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def knobs_of(text: Any) -> dict[str, Any]:
    """The knobs of an entry; none where they are no JSON object."""
    value = json.loads(text) if isinstance(text, str) and text else {}
    return value if isinstance(value, dict) else {}


def _scores(
    entries: pd.DataFrame,
    values: pd.DataFrame,
    floor: pd.DataFrame,
    against: str | None,
    unbiased: Sequence[str],
) -> list[dict[str, Any]]:
    rows = []
    for (part, metric), table in values.groupby(["part", "metric"], sort=True):
        # An infinite value of one seed leaves the frame out, as a missing one does.
        finite_table = table.assign(value=table["value"].where(np.isfinite(table["value"])))
        grid = finite_table.pivot(index=["scene", "frame"], columns=["entry", "seed"], values="value")
        rooms = grid.index.get_level_values("scene").to_numpy()
        noise = floor[(floor["part"] == part) & (floor["metric"] == metric)]
        for entry in grid.columns.unique("entry"):
            measured = grid.index.isin(_frames_of(table, entry))
            seeds = grid[entry].to_numpy()  # a row a frame, a column a seed
            finite = np.isfinite(seeds).all(axis=1)
            scenes = set(rooms[measured])
            level = noise_level(noise, scenes)
            row: dict[str, Any] = {"entry": entry, "part": part, "metric": metric, "floor": level}
            row["left_out"] = int((measured & ~finite).sum())
            row |= _mean(seeds[finite].T, rooms[finite])
            other = _opponent(entries, entry, against)
            if other in grid.columns.unique("entry"):
                opponent = grid[other].to_numpy()
                # What is against the truth does not depend on what the reference has wrong.
                doubt = math.nan if metric in unbiased else level
                row |= _difference(seeds, opponent, rooms, METRICS[str(metric)], doubt)
            rows.append(row)
    return rows


def noise_level(noise: pd.DataFrame, scenes: set[Any]) -> float:
    """Mean over some scenes of the floor of a part and metric, each the mean of its frames; NaN where none is known."""
    own = noise[noise["scene"].isin(scenes) & np.isfinite(noise["value"])]
    return float(own.groupby("scene")["value"].mean().mean())


def _frames_of(table: pd.DataFrame, entry: Any) -> pd.MultiIndex:
    return table.loc[table["entry"] == entry].set_index(["scene", "frame"]).index


def _mean(values: np.ndarray, rooms: np.ndarray) -> dict[str, Any]:
    if not len(rooms):
        return {"mean": math.nan, "low": math.nan, "high": math.nan, "rooms": 0, "frames": 0}
    found = mean_interval(values, rooms)
    return {
        "mean": found.mean,
        "low": found.low,
        "high": found.high,
        "rooms": found.rooms,
        "frames": found.frames,
    }


def _opponent(entries: pd.DataFrame, entry: Any, against: str | None) -> Any:
    # Of the same track, and of the same machine where there is one.
    if against is None:
        return None
    own = entries.loc[entry]
    same = entries[(entries["label"] == against) & (entries["track"] == own["track"])]
    if same.empty:
        return None
    near = same[same["machine"] == own["machine"]]
    return (near if len(near) else same).index[0]


def _difference(
    first: np.ndarray, second: np.ndarray, rooms: np.ndarray, metric: Any, floor: float
) -> dict[str, Any]:
    both = np.isfinite(first).all(axis=1) & np.isfinite(second).all(axis=1)
    if not both.any():
        return {}
    found = paired_difference(first[both].T, second[both].T, rooms[both])
    return {
        "difference": found.mean,
        "difference_low": found.low,
        "difference_high": found.high,
        "verdict": verdict(found, noise_size(metric, floor), metric.direction),
    }


def noise_size(metric: Any, floor: float) -> float:
    """Shift of a metric by the reference's noise alone: from its value for equal images to its floor.

    NaN where that is not known: no floor, or a metric such as PSNR that is infinite for equal images.
    """
    if metric.identity is None or not math.isfinite(metric.identity):
        return math.nan
    return abs(floor - metric.identity)
