"""The plot of error against a setting: wavelets, samples, training images or rooms. Is more of it worth its cost?"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from gibench.benchmarks.report.figures import (
    BETWEEN,
    WIDTH,
    about_intervals,
    end_labels,
    error_axis,
    lowest_shown,
    new_figure,
    new_panel,
    noise_band,
    short,
    widest,
    without_longest,
    write_title,
)
from gibench.benchmarks.report.plot_style import LINES, look, tick_text
from gibench.benchmarks.report.runs import part_title
from gibench.benchmarks.report.summary import Summary, is_number, knobs_of, label_without, noise_level
from gibench.benchmarks.report.wording import metric_title, printable
from gibench.metrics import METRICS, mean_interval

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEAST = 3
"""Values of a setting that make a line."""

COLUMNS = 2
PANEL = 1.7
"""Inches, the height of a panel."""

MOST_TICKS = 8


@dataclass(frozen=True, eq=False)
class Sweep:
    """A method at LEAST values or more of one numeric knob, all else equal.

    lines: rows of the settings with `value` of the knob, mean, low, high and floor, by what else is set. named: whether
    they need names, several or one that is not over all rooms.
    """

    method: str
    knob: str
    lines: dict[str, pd.DataFrame]
    named: bool

    @property
    def values(self) -> list[float]:
        """All that the knob takes, smallest first."""
        return sorted({float(value) for rows in self.lines.values() for value in rows["value"]})


def sweeps(summary: Summary, track: str, part: str, metric: str, machine: str) -> list[Sweep]:
    """Find what was turned: a sweep for each method and knob."""
    found = []
    for method, own in summary.points(track, part, metric, machine).groupby("method", sort=False):
        knobs = [knobs_of(text) for text in own["knobs"]]
        for knob in dict.fromkeys(name for setting in knobs for name in setting):
            lines: dict[str, pd.DataFrame] = {}
            fewer = False
            values = [_number(setting.get(knob)) for setting in knobs]
            others = [
                json.dumps({k: v for k, v in setting.items() if k != knob}, sort_keys=True)
                for setting in knobs
            ]
            rows = own.assign(value=values, others=others).dropna(subset="value").sort_values("value")
            for _, line in rows.groupby("others", sort=False):
                if line["value"].nunique() >= LEAST:
                    name = label_without(str(line["label"].iloc[0]), knob)
                    shared, rooms = _in_shared_rooms(summary, line, part, metric)
                    if shared is not line:
                        name, fewer = f"{name} ({rooms} of {line['rooms'].max()} rooms)", True
                    if rooms:
                        lines[name] = shared
            if lines:
                found.append(Sweep(str(method), knob, lines, fewer or len(lines) > 1))
    return found


def _in_shared_rooms(
    summary: Summary, line: pd.DataFrame, part: str, metric: str
) -> tuple[pd.DataFrame, int]:
    """The line over the rooms that all of its settings were measured in, and their number: another room is no setting.

    Where all were measured in the same rooms it is the line itself. Else seeds are averaged before intervals are taken.
    """
    values, floor = (
        table[(table["part"] == part) & (table["metric"] == metric)]
        for table in (summary.values, summary.floor)
    )
    values = values[np.isfinite(values["value"])]
    own = {entry: values[values["entry"] == entry] for entry in line.index}
    rooms = [set(frames["scene"]) for frames in own.values()]
    shared = set.intersection(*rooms)
    if all(one == shared for one in rooms) or not shared:
        return line, len(shared)
    line = line.copy()
    for entry, frames in own.items():
        frames = frames[frames["scene"].isin(shared)]
        found = mean_interval(frames["value"].to_numpy(), frames["scene"].to_numpy())
        ends = np.array([found.low, found.high])
        line.loc[entry, ["mean", "low", "high"]] = [found.mean, *np.where(np.isfinite(ends), ends, np.nan)]
    line["floor"] = noise_level(floor, shared)
    return line, len(shared)


def error_against_settings(
    summary: Summary, track: str, part: str, metric: str, machine: str
) -> Figure | None:
    """Plot error against each knob that was turned, a panel each, under one scale of error. None where none was."""
    found = sweeps(summary, track, part, metric, machine)
    if not found:
        return None
    import pandas as pd

    everything = pd.concat([rows for sweep in found for rows in sweep.lines.values()])
    higher = METRICS[metric].direction == "higher"
    logarithmic = not higher and bool((everything["mean"] > 0).all())
    rows = math.ceil(len(found) / COLUMNS)
    top, bottom, gap, left, between = 0.78, 0.42, 0.62, 0.72, 0.3
    height = top + rows * PANEL + (rows - 1) * gap + bottom
    figure, first = new_figure(WIDTH, height)
    first.remove()
    lowest = lowest_shown(everything["mean"], logarithmic)
    about = BETWEEN.join([part_title(part), f"track {short(track)}", "95 % intervals", short(machine)])
    about += about_intervals(everything["low"], lowest)
    everything = without_longest(everything, lowest)
    write_title(figure, f"{metric_title(metric)} against settings", about)
    named = [short(name) for sweep in found if sweep.named for name in sweep.lines]
    beside = min(widest(figure, named) + 0.3, WIDTH / 4) if named else 0.1
    width = (WIDTH - left - between - 0.1) / COLUMNS
    methods = list(summary.entries["method"].unique())
    for number, sweep in enumerate(found):
        row, column = divmod(number, COLUMNS)
        place = (
            left + column * (width + between),
            height - top - PANEL - row * (PANEL + gap),
            width - beside,
            PANEL,
        )
        axes = new_panel(figure, place)
        floors = everything["floor"]
        error_axis(axes, everything["low"], everything["high"], everything["mean"], floors, logarithmic)
        noise_band(axes, float(floors.mean()), higher)
        _values(axes, sweep.values)
        axes.set_title(short(sweep.method), size=8, pad=3, loc="left")
        axes.set_xlabel(printable(sweep.knob))
        if column:
            axes.set_yticklabels([])
        else:
            axes.set_ylabel(f"{metric_title(metric)}, {'higher' if higher else 'lower'} is better")
        style = look(methods.index(sweep.method))
        ends = []
        for (name, line), dashes in zip(sweep.lines.items(), LINES * len(sweep.lines), strict=False):
            _line(axes, without_longest(line, lowest), style, dashes)
            ends.append((short(name), float(line["mean"].iloc[-1]), style["color"]))
        if sweep.named:
            end_labels(figure, axes, ends)
    return figure


def _number(value: Any) -> float:
    return float(value) if is_number(value) else math.nan


def _values(axes: Axes, values: list[float]) -> None:
    """Lay out the axis of a knob, with ticks at the values that it took."""
    from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator

    if values[0] > 0:
        axes.set_xscale("log")
        pad = (values[-1] / values[0]) ** 0.06
        axes.set_xlim(values[0] / pad, values[-1] * pad)
    else:
        pad = 0.06 * (values[-1] - values[0])
        axes.set_xlim(values[0] - pad, values[-1] + pad)
    ticks = values[:: math.ceil(len(values) / MOST_TICKS)]
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FixedFormatter([tick_text(value) for value in ticks]))


def _line(axes: Axes, line: pd.DataFrame, style: dict[str, Any], dashes: Any) -> None:
    across, up = line["value"].to_numpy(float), line["mean"].to_numpy(float)
    spans = np.abs(np.stack([line["low"], line["high"]]) - up)
    colour = style["color"]
    axes.errorbar(across, up, yerr=spans, fmt="none", ecolor=colour, elinewidth=0.9, capsize=1.8, zorder=3)
    axes.plot(
        across,
        up,
        color=colour,
        linewidth=1.1,
        linestyle=dashes,
        marker=style["marker"],
        markersize=4,
        zorder=4,
    )
