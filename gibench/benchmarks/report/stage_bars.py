"""The plot of where the time of a frame goes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from gibench.benchmarks.report.figures import (
    BETWEEN,
    SMALL,
    WIDTH,
    entry_name,
    new_figure,
    new_panel,
    short,
    widest,
    write_title,
)
from gibench.benchmarks.report.plot_style import FAINT, look
from gibench.benchmarks.report.source import ReportSource
from gibench.benchmarks.report.summary import Summary
from gibench.benchmarks.report.tables import stage_times
from gibench.benchmarks.report.wording import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def stage_bars(source: ReportSource, summary: Summary, track: str, machine: str) -> Figure | None:
    """Plot the share of each stage in a frame, a row a setting, with its milliseconds; None without stages."""
    times = stage_times(source, summary)
    of = summary.entries[(summary.entries["track"] == track) & (summary.entries["machine"] == machine)]
    order = of["ms_median"].dropna().sort_values().index
    times = times.loc[[entry for entry in order if entry in times.index]].dropna(axis="columns", how="all")
    if times.empty:
        return None
    total = of["ms_median"].loc[times.index]
    shares = times.div(np.maximum(total, times.sum(axis="columns")), axis="index")
    beside = len(machine) <= 40  # the title; a longer name has a line of its own below
    row, top, bottom = 0.17, 0.78, 0.42 if beside else 0.56
    names = [entry_name(summary, entry) for entry in times.index]
    height = top + bottom + row * len(times)
    figure, first = new_figure(WIDTH, height)
    first.remove()
    left = widest(figure, names) + 0.2
    about = f"track {track}{BETWEEN}medians over the path, means over rooms; numbers are milliseconds"
    write_title(figure, "Where the time of a frame goes", f"{about}{BETWEEN}{machine}" if beside else about)
    columns = [*times.columns, "frame"]
    width = (WIDTH - left - 0.1) / len(columns)
    for position, column in enumerate(columns):
        axes = new_panel(figure, (left + position * width, bottom, width * 0.92, row * len(times)))
        axes.grid(False)
        axes.set_ylim(len(times) - 0.5, -0.5)
        axes.set_xlim(0, 1)
        axes.tick_params(length=0)
        axes.spines[["bottom", "left"]].set_visible(False)
        axes.set_yticks(range(len(times)), names if position == 0 else [], size=SMALL)
        axes.set_xticks([])
        axes.set_title(short(column), size=SMALL, pad=3, loc="left")
        if column == "frame":
            for at, value in enumerate(total):
                axes.text(0, at, number(float(value)), size=SMALL, va="center_baseline", weight="bold")
            continue
        axes.axvline(0, color=FAINT, linewidth=0.6)
        # Bars take half of the column, so that every number has room beside its bar.
        own = shares[column].fillna(0.0).to_numpy()
        axes.barh(range(len(times)), own * 0.5, height=0.62, color=look(0)["color"], linewidth=0)
        for at, (share, value) in enumerate(zip(own, times[column], strict=True)):
            if math.isfinite(value):
                axes.text(
                    share * 0.5 + 0.04, at, number(float(value)), size=SMALL - 0.4, va="center_baseline"
                )
    note = "bar: share of the frame; half a column is all of it"
    for line, text in enumerate([note] if beside else [machine, note]):
        figure.text(left / WIDTH, (0.16 + 0.14 * line) / height, text, size=SMALL, color=FAINT)
    return figure
