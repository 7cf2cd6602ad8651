r"""The tables of the papers, as Markdown and LaTeX.

Error by scene and metric (Efficient Light Probes, Table 1), error over all rooms (Glossy Probe Reprojection,
Table 1), preparation (Efficient Light Probes, Table 2) with its memory (Glossy Probe Reprojection, Table 2), and
time per frame by stage (Efficient Light Probes, Table 3). LaTeX needs only the package booktabs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gibench.benchmarks.report.csv_files import short_reason
from gibench.benchmarks.report.runs import APART, image_part, part_title
from gibench.benchmarks.report.source import PREPARATION, ReportSource
from gibench.benchmarks.report.summary import Summary
from gibench.benchmarks.report.wording import MISSING, against, metric_title, number, printable, seconds, size
from gibench.datasets.files import write_whole
from gibench.metrics import METRICS

if TYPE_CHECKING:
    import pandas as pd


STAGES = ("g-buffer", "ray casting", "search", "gather", "filtering", "denoising", "inference")
"""The order in which a frame passes its stages; a method's own stages come after them, "other" last."""


@dataclass(frozen=True)
class Cell:
    """A text, and whether it is the best of its column."""

    text: str
    best: bool = False


@dataclass(frozen=True)
class Table:
    """A table ready to be written.

    caption: one or more sentences. head: the column names. groups: rows by what they share in their first cell
    (None for rows that share nothing), in order. words: how many columns, from the left, hold words.
    """

    caption: str
    head: Sequence[str]
    groups: Sequence[tuple[str | None, Sequence[Sequence[Cell]]]]
    words: int = 1

    def markdown(self) -> str:
        """Write it as GitHub-flavoured Markdown."""
        lines = [_markdown(self.caption), "", _pipes(self.head)]
        lines.append(_pipes(["---"] * self.words + ["---:"] * (len(self.head) - self.words)))
        for name, rows in self.groups:
            for position, row in enumerate(rows):
                cells = [f"**{cell.text}**" if cell.best else cell.text for cell in row]
                front = [] if name is None else [name if position == 0 else ""]
                lines.append(_pipes([*front, *cells]))
        return "\n".join(lines) + "\n"

    def latex(self) -> str:
        """Write it as a LaTeX table environment."""
        columns = "l" * self.words + "r" * (len(self.head) - self.words)
        lines = [
            r"\begin{table}",
            r"\centering",
            rf"\caption{{{_tex(self.caption)}}}",
            rf"\begin{{tabular}}{{{columns}}}",
            r"\toprule",
            " & ".join(_tex(name) for name in self.head) + r" \\",
        ]
        for name, rows in self.groups:
            lines.append(r"\midrule")
            for position, row in enumerate(rows):
                cells = [rf"\textbf{{{_tex(cell.text)}}}" if cell.best else _tex(cell.text) for cell in row]
                front = [] if name is None else [_tex(name) if position == 0 else ""]
                lines.append(" & ".join([*front, *cells]) + r" \\")
        return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", r"\end{table}"]) + "\n"


def write_tables(source: ReportSource, summary: Summary, out: Path) -> list[Path]:
    """Write every table as <name>.md and <name>.tex into a folder."""
    written = []
    for name, table in tables(source, summary).items():
        for suffix, text in ((".md", table.markdown()), (".tex", table.latex())):
            write_whole(out / f"{name}{suffix}", text.encode())
            written.append(out / f"{name}{suffix}")
    return written


def tables(source: ReportSource, summary: Summary) -> dict[str, Table]:
    """Make all tables by name; those of a track carry its name where there are several."""
    made: dict[str, Table] = {}
    for track in summary.tracks:
        prefix = f"{track}-" if len(summary.tracks) > 1 else ""
        for part in summary.parts:
            if not _of_track(summary, track, part):
                continue
            name = f"{prefix}errors-{part.replace(APART, '-')}"
            made[name] = errors(summary, track, part)
            if part == image_part(part):
                made[f"{name}-by-scene"] = errors_by_scene(summary, track, part)
        made[f"{prefix}preparation"] = preparation(summary, track)
        made[f"{prefix}frame-time"] = frame_time(source, summary, track)
    if (summary.results["status"] != "ok").any():
        made["failed"] = failed(summary)
    return made


def errors(summary: Summary, track: str, part: str) -> Table:
    """Setting × metric, means over all rooms with their 95 % intervals."""
    metrics = summary.metrics(part)
    scores = summary.scores[summary.scores["part"] == part].set_index(["entry", "metric"])
    entries = _of_track(summary, track, part)
    whole = _in_most_rooms(scores, entries)
    best = {metric: _best(metric, [_score(scores, e, metric, "mean") for e in whole]) for metric in metrics}
    rows = []
    for entry in entries:
        cells = [_name(summary, entry)]
        for metric in metrics:
            mean, low, high = (_score(scores, entry, metric, name) for name in ("mean", "low", "high"))
            text = f"{number(mean)} [{number(low)}, {number(high)}]" if math.isfinite(mean) else number(mean)
            cells.append(Cell(text, mean == best[metric] and entry in whole))
        rows.append(cells)
    groups: list[tuple[str | None, Sequence[Sequence[Cell]]]] = [(None, rows)]
    floors = [
        Cell(number(_finite_mean(_score(scores, entry, metric, "floor") for entry in entries)))
        for metric in metrics
    ]
    groups.append((None, [[Cell("noise floor of the reference"), *floors]]))
    caption = (
        f"{part_title(part)}, track {track}: means over all rooms and their 95 % intervals over rooms and seeds. "
        f"The best of a column is bold. {against(metrics, summary.unbiased)} "
    ) + _directions(metrics)
    return Table(caption, ["Method", *map(metric_title, metrics)], groups)


def errors_by_scene(summary: Summary, track: str, part: str) -> Table:
    """Scene, setting × metric: Table 1 of Efficient Light Probes."""
    metrics = summary.metrics(part)
    entries = _of_track(summary, track, part)
    values = summary.values[(summary.values["part"] == part) & summary.values["entry"].isin(entries)]
    values = values[_finite(values["value"])]
    means = values.groupby(["scene", "entry", "metric"])["value"].mean()
    floor = summary.floor[(summary.floor["part"] == part) & _finite(summary.floor["value"])]
    floors = floor.groupby(["scene", "metric"])["value"].mean()
    groups: list[tuple[str | None, Sequence[Sequence[Cell]]]] = []
    for scene in sorted(values["scene"].unique()):
        best = {m: _best(m, [float(means.get((scene, e, m), math.nan)) for e in entries]) for m in metrics}
        rows = []
        for entry in entries:
            found = {m: float(means.get((scene, entry, m), math.nan)) for m in metrics}
            if all(math.isnan(value) for value in found.values()):
                continue
            cells = [Cell(number(value), value == best[m]) for m, value in found.items()]
            rows.append([_name(summary, entry, rooms=False), *cells])
        noise = [Cell(number(float(floors.get((scene, m), math.nan)))) for m in metrics]
        rows.append([Cell("noise floor"), *noise])
        groups.append((scene, rows))
    caption = (
        f"{part_title(part)} by scene, track {track}: means over the frames of the path. "
        "The best of a scene is bold. "
    ) + _directions(metrics)
    return Table(caption, ["Scene", "Method", *map(metric_title, metrics)], groups, words=2)


def preparation(summary: Summary, track: str) -> Table:
    """Setting × what was prepared: Table 2 of Efficient Light Probes, with sizes."""
    columns = [f"prepare_{name}_s" for name in PREPARATION]
    rows = []
    for entry in summary.entries.index[summary.entries["track"] == track]:
        own = summary.entries.loc[entry]
        if not own["rooms"]:
            continue
        parts = [seconds(own[name]) if own[name] > 0 else MISSING for name in columns]
        cells = [*parts, seconds(own["prepare_s"]), size(own["bytes"]), size(own["peak_mb"] * 1e6)]
        rows.append([_name(summary, entry), *map(Cell, cells)])
    caption = (
        f"Preparation of a room, track {track}: means over rooms; what was baked is on disk, the memory is the "
        f"largest of any room. {_machines(summary)}"
    )
    head = ["Method", "Lightmap", "Probes", "References", "Training", "Total", "On disk", "Peak memory"]
    return Table(caption, head, [(None, rows)])


def frame_time(source: ReportSource, summary: Summary, track: str) -> Table:
    """Setting × stage, milliseconds per frame: Table 3 of Efficient Light Probes."""
    times = stage_times(source, summary)
    stages = list(times.columns)
    rows = []
    for entry in summary.entries.index[summary.entries["track"] == track]:
        own = summary.entries.loc[entry]
        if not own["rooms"]:
            continue
        found = [float(times[stage].get(entry, math.nan)) for stage in stages]
        cells = [*(number(value) for value in found), number(own["ms_median"]), number(own["ms_p95"])]
        rows.append([_name(summary, entry), *map(Cell, cells)])
    caption = (
        f"Milliseconds per frame by stage, track {track}: medians over the frames of a path, averaged over rooms; "
        f"the stages need not add up to the frame. {_machines(summary)}"
    )
    return Table(
        caption, ["Method", *map(str.capitalize, stages), "Frame", "95th percentile"], [(None, rows)]
    )


def failed(summary: Summary) -> Table:
    """Failed results, with the reason."""
    lost = summary.results[summary.results["status"] != "ok"]
    rows = [
        [Cell(str(row.label)), Cell(str(row.scene)), Cell(str(row.seed)), Cell(short_reason(row.reason))]
        for row in lost.itertuples()
    ]
    caption = f"{len(lost)} of {len(summary.results)} results failed."
    return Table(caption, ["Method", "Scene", "Seed", "Reason"], [(None, rows)], words=4)


def stage_times(source: ReportSource, summary: Summary) -> pd.DataFrame:
    """Milliseconds by entry (rows) and stage (columns, in the order of a frame), means over rooms of medians."""
    of = summary.results.loc[summary.results["status"] == "ok", ["result", "entry", "scene"]]
    rows = source.stages.merge(of, on="result")
    order = sorted(
        source.stages["stage"].unique(),
        key=lambda name: STAGES.index(name) if name in STAGES else len(STAGES),
    )
    rooms = rows.groupby(["entry", "scene", "stage"])["ms_median"].mean()
    return rooms.groupby(["entry", "stage"]).mean().unstack("stage").reindex(columns=order)


def _of_track(summary: Summary, track: str, part: str) -> list[Any]:
    scored = set(summary.scores.loc[summary.scores["part"] == part, "entry"])
    of = summary.entries.index[summary.entries["track"] == track]
    return [entry for entry in of if entry in scored]


def _in_most_rooms(scores: pd.DataFrame, entries: Sequence[Any]) -> list[Any]:
    # A mean over fewer rooms, the hard ones failed, is no better than the others.
    rooms = scores["rooms"].groupby("entry").max()
    return [entry for entry in entries if rooms[entry] == rooms.max()]


def _score(scores: pd.DataFrame, entry: Any, metric: str, name: str) -> float:
    return float(scores[name].get((entry, metric), math.nan))


def _best(metric: str, values: Sequence[float]) -> float:
    finite = [value for value in values if math.isfinite(value)]
    if not finite:
        return math.nan
    return min(finite) if METRICS[metric].direction == "lower" else max(finite)


def _finite(values: pd.Series) -> pd.Series:
    return values.abs() < math.inf


def _finite_mean(values: Any) -> float:
    finite = [value for value in values if math.isfinite(value)]
    return sum(finite) / len(finite) if finite else math.nan


def _name(summary: Summary, entry: Any, *, rooms: bool = True) -> Cell:
    own = summary.entries.loc[entry]
    text = str(own["label"])
    if len(summary.machines) > 1:
        text += f" on {own['machine']}"
    if rooms and own["failed_rooms"]:
        text += f" ({own['rooms']} of {own['rooms'] + own['failed_rooms']} rooms)"
    return Cell(text)


def _machines(summary: Summary) -> str:
    if len(summary.machines) == 1:
        return f"Machine: {summary.machines[0]}."
    return "Results come from several machines, whose times must not be compared: " + ", ".join(
        summary.machines
    )


def _directions(metrics: Sequence[str]) -> str:
    higher = [metric_title(name) for name in metrics if METRICS[name].direction == "higher"]
    return "Lower is better" + (f", except for {' and '.join(higher)}." if higher else ".")


def _pipes(cells: Sequence[str]) -> str:
    return "| " + " | ".join(map(_markdown, cells)) + " |"


_MARKDOWN = {**{sign: f"\\{sign}" for sign in "|\\`"}, "<": "&lt;", ">": "&gt;", "&": "&amp;"}
"""Characters that would end a cell, or that a viewer takes for HTML. Stars are our own: the best of a column."""


def _markdown(text: str) -> str:
    return "".join(_MARKDOWN.get(sign, sign) for sign in " ".join(printable(text).split()))


_TEX = {
    **{sign: f"\\{sign}" for sign in "&%$#_{}"},
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "–": "--",
    "−": "$-$",
    "∞": r"$\infty$",
    "×": r"$\times$",
}


def _tex(text: str) -> str:
    return "".join(_TEX.get(sign, sign) for sign in printable(text))
