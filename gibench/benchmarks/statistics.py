"""Means over rooms with their intervals, and paired differences: which method is better, and how sure that is.

Rooms are what is drawn at random; frames of a room resemble each other, so intervals come from the spread of rooms, and
of a trained method from that of its seeds too, which are crossed with the rooms (`gibench.metrics.mean_interval`).
Errors do not depend on the machine and are pooled over machines; times are not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from gibench.benchmarks.errors import ResultsError
from gibench.benchmarks.results import WHOLE_PATH, Results
from gibench.datasets.errors import nearest
from gibench.metrics import METRICS, Interval, mean_interval, metric, paired_difference

if TYPE_CHECKING:
    import pandas as pd

Verdict = Literal["better", "worse", "unsure", "below the noise floor"]


@dataclass(frozen=True)
class Difference:
    """A method against another on the same frames, first less second.

    interval: of the mean difference, 95 %. floor: the difference that the noise of the references alone could explain;
    NaN where it is not known, and where the metric is against the truth (`Results.unbiased`), whose noise is in the
    interval. verdict: of the first: "better" or "worse" only where the interval excludes zero and the
    difference is above the floor.
    """

    first: str
    second: str
    metric: str
    part: str
    interval: Interval
    floor: float
    verdict: Verdict


def frame_values(results: Results, name: str, part: str) -> pd.DataFrame:
    """A row a frame, or for a temporal metric a row a sequence: label, method, scene, frame, seed, machine, value.

    Undefined values are left out. Raises UnknownMetricError, ResultsError where the metric was not computed.
    """
    temporal = metric(name).inputs == "sequence"
    table = _numbered(results.sequences) if temporal else results.frames
    table = table[(table["metric"] == name) & (table["part"] == part)]
    columns = ["result", "label", "method", "scene", "seed", "machine"]
    table = table.merge(results.results[columns], on="result").dropna(subset="value")
    if table.empty:
        of_track = name in (*results.run["metrics"], *results.run["sequence_metrics"])
        command = f"gibench bench score {results.root}" + ("" if of_track else f" --metrics {name}")
        why = results.skipped.get(name, f"`{command}` computes it")
        raise ResultsError(f"{results.root} has no {name} of the {part} image: {why}")
    return table[["label", "method", "scene", "frame", "seed", "machine", "value"]]


def _numbered(sequences: pd.DataFrame) -> pd.DataFrame:
    """Sequences with the numbers that they have in `Results.floor`."""
    order = sequences.groupby(["result", "metric", "part"], sort=False).cumcount()
    return sequences.assign(frame=WHOLE_PATH - order)


def floor(results: Results, name: str, part: str) -> float:
    """Noise floor: error of a perfect method against noisy references, as a distance from the perfect value.

    The mean over scenes of their frames' means. NaN where it is not known: for the specular part, and for metrics whose
    perfect value is none or infinite.
    """
    identity = METRICS[name].identity
    table = results.floor
    table = table[(table["metric"] == name) & (table["part"] == part)].dropna(subset="value")
    if identity is None or not np.isfinite(identity) or table.empty:
        return float("nan")
    return float((table["value"] - identity).abs().groupby(table["scene"]).mean().mean())


def leaderboard(results: Results, name: str, part: str = "full") -> pd.DataFrame:
    """A row a label and machine, best first.

    Columns: label, method, title, family, machine, mean, low, high (of the metric, 95 %), rooms, ms and ms_p95 (means
    over results of the median and the 95th percentile), prepare_s, bytes, peak_mb (means over results), failed
    (results that failed). Times of different machines stand in different rows. A label whose results all failed has
    NaN and comes last.
    """
    import pandas as pd

    values = frame_values(results, name, part)
    rows = []
    for (label, machine), group in results.results.groupby(["label", "machine"], sort=False):
        own = values[(values["label"] == label) & (values["machine"] == machine)]
        interval = mean_interval(*_by_seed(own, "scene")) if len(own) else None
        good = group[group["status"] == "ok"]
        rows.append(
            {
                "label": label,
                "method": group["method"].iloc[0],
                "title": group["title"].iloc[0],
                "family": group["family"].iloc[0],
                "machine": machine,
                "mean": interval.mean if interval else float("nan"),
                "low": interval.low if interval else float("nan"),
                "high": interval.high if interval else float("nan"),
                "rooms": interval.rooms if interval else 0,
                "ms": good["ms_median"].mean(),
                "ms_p95": good["ms_p95"].mean(),
                "prepare_s": good["prepare_s"].mean(),
                "bytes": good["bytes"].mean(),
                "peak_mb": good["peak_mb"].mean(),
                "failed": int((group["status"] != "ok").sum()),
            }
        )
    lower = METRICS[name].direction == "lower"
    table = pd.DataFrame(rows).sort_values("mean", ascending=lower, na_position="last", kind="stable")
    return table.reset_index(drop=True)


def labels_of(results: Results, name: str) -> list[str]:
    """Labels that a name stands for: itself, or those of the method that it is the id of. Raises ResultsError."""
    table = results.results
    if name in set(table["label"]):
        return [name]
    labels = list(dict.fromkeys(table[table["method"] == name]["label"]))
    if table.empty:
        raise ResultsError(f"{results.root} has no results yet: `{results.run['command']}` makes them")
    if not labels:
        known = sorted({*table["label"], *table["method"]})
        raise ResultsError(f"{results.root} has no method '{name}'; {nearest(name, known)}")
    return labels


def difference(first: tuple[Results, str], second: tuple[Results, str], name: str, part: str) -> Difference:
    """Compare two labels on the frames that both have. The two may come from different folders.

    Scenes are the same where their content is. A frame counts where every seed has it. Raises ResultsError where
    nothing is shared.
    """
    tables = [_by_frame(results, label, name, part) for results, label in (first, second)]
    both = tables[0].index.intersection(tables[1].index)
    if both.empty:
        raise ResultsError(
            f"'{first[1]}' and '{second[1]}' share no frame with a {name} of the {part} image: compare runs of the "
            "same track, preset and seed"
        )
    values = [table.loc[both].to_numpy().T for table in tables]
    interval = paired_difference(values[0], values[1], both.get_level_values("content").to_numpy())
    truly = all(name in results.unbiased for results, _ in (first, second))
    noise = float("nan") if truly else floor(first[0], name, part)
    return Difference(
        first[1], second[1], name, part, interval, noise, verdict(interval, noise, METRICS[name].direction)
    )


def verdict(interval: Interval, noise: float, direction: str) -> Verdict:
    """Verdict on a difference. noise: see `Difference.floor`; NaN leaves it out."""
    if not interval.excludes_zero:
        return "unsure"
    if abs(interval.mean) < noise:
        return "below the noise floor"
    return "better" if (interval.mean < 0) == (direction == "lower") else "worse"


def _by_frame(results: Results, label: str, name: str, part: str) -> pd.DataFrame:
    """A row a frame, indexed by content and frame, and a column a seed."""
    values = frame_values(results, name, part)
    values = values[values["label"] == label]
    contents = {r["config"]["scene"]: r["config"]["scene_sha256"] for r in results.records()}
    values = values.assign(content=values["scene"].map(contents))
    return seeds_apart(values, "content")


def seeds_apart(values: pd.DataFrame, room: str) -> pd.DataFrame:
    """A row a frame that every seed has, indexed by room and frame, and a column a seed. room: the column of rooms."""
    return values.pivot_table(index=[room, "frame"], columns="seed", values="value").dropna()


def _by_seed(values: pd.DataFrame, room: str) -> tuple[np.ndarray, np.ndarray]:
    """Values (S, F) and the rooms of the frames (F,)."""
    table = seeds_apart(values, room)
    return table.to_numpy().T, table.index.get_level_values(room).to_numpy()
