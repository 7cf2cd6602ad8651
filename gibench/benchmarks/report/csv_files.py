"""The run as CSV files: a row a fact, so that any tool can take it from there."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pandas.api.types import is_numeric_dtype

from gibench.benchmarks.report.source import ReportSource
from gibench.benchmarks.report.summary import COSTS, ENTRY, Summary
from gibench.datasets.files import write_whole

if TYPE_CHECKING:
    import pandas as pd

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""Beginnings of texts that spreadsheets take for formulas."""

_WHO = ["track", "scene", "method", "label", "knobs", "seed", "machine", "result"]
_LOOK = ["training", "step", "seconds", "error", "kept"]


def write_csv_files(source: ReportSource, summary: Summary, out: Path) -> list[Path]:
    """Write leaderboard.csv, frames.csv, sequences.csv, stages.csv, training.csv, extras.csv and results.csv.

    Times are milliseconds where a name ends in _ms or begins with ms, seconds where it ends in _s or is
    seconds; memory is MB.
    """
    of = summary.results[_WHO]
    frames = source.frames.merge(of, on="result")
    floor = summary.floor.rename(columns={"value": "noise_floor"})
    frames = frames.merge(floor, on=["scene", "frame", "part", "metric"], how="left")
    tables = {
        "leaderboard.csv": leaderboard(summary),
        "frames.csv": frames[[*_WHO, "frame", "ms", "part", "metric", "value", "noise_floor"]],
        "sequences.csv": source.sequences.merge(of, on="result")[[*_WHO, "part", "metric", "value"]],
        "stages.csv": source.stages.merge(of, on="result")[[*_WHO, "stage", "ms_median", "ms_p95"]],
        "training.csv": source.curves.merge(of, on="result")[[*_WHO, *_LOOK]],
        "extras.csv": source.extras.merge(of, on="result")[[*_WHO, "frame", "name", "value"]],
        "results.csv": summary.results.drop(columns="entry"),
    }
    for name, table in tables.items():
        write_whole(out / name, _plain(table).to_csv(index=False, float_format="%.7g").encode())
    return [out / name for name in tables]


def _plain(table: pd.DataFrame) -> pd.DataFrame:
    """Texts that no spreadsheet takes for a formula: one that begins like one gets an apostrophe before it."""
    table = table.copy()
    for name in table.columns:
        if not is_numeric_dtype(table[name]):
            texts = table[name].astype("object")
            formula = texts.map(lambda text: isinstance(text, str) and text.startswith(FORMULA))
            table[name] = texts.where(~formula, "'" + texts.astype(str))
    return table


def leaderboard(summary: Summary) -> pd.DataFrame:
    """Give a row by setting, part and metric, best first; a setting that failed everywhere has one without numbers.

    reason tells what went wrong where failed_rooms is not 0.
    """
    from gibench.metrics import METRICS

    entries = summary.entries.assign(reason=_reasons(summary))
    who = [*ENTRY, "method", "title", "family", "knobs", "failed_rooms", "reason", "seeds"]
    table = entries[[*who, *COSTS, "peak_mb"]].merge(
        summary.scores, left_index=True, right_on="entry", how="left"
    )
    table["status"] = table["metric"].isna().map({True: "failed", False: "ok"})
    table["against"] = summary.against if summary.against is not None else ""
    higher = [name for name, descriptor in METRICS.items() if descriptor.direction == "higher"]
    best_first = table["mean"].where(~table["metric"].isin(higher), -table["mean"])
    table = (
        table.assign(best_first=best_first)
        .sort_values(["track", "part", "metric", "best_first"], kind="stable", na_position="last")
        .drop(columns="best_first")
    )
    scored = [
        *("mean", "low", "high", "rooms", "frames", "left_out", "floor", "against"),
        *("difference", "difference_low", "difference_high", "verdict"),
    ]
    front = ["track", "part", "metric", "method", "label", "status"]
    rest = [name for name in [*who, *COSTS, "peak_mb"] if name not in front]
    return table[[*front, *scored, *rest]]


def _reasons(summary: Summary) -> list[str]:
    failed = summary.results[summary.results["status"] != "ok"]
    texts = []
    for entry in summary.entries.index:
        own = failed[failed["entry"] == entry]
        texts.append("; ".join(f"{row.scene}: {short_reason(row.reason)}" for row in own.itertuples()))
    return texts


def short_reason(reason: object) -> str:
    """Give the line of a traceback that says what went wrong: the last one."""
    lines = [line.strip() for line in str(reason or "").splitlines() if line.strip()]
    return lines[-1] if lines else "no reason was recorded"
