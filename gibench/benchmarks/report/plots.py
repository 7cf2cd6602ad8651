"""The plots of a run: error against what it costs, error along the path, and where the time of a frame goes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gibench.benchmarks.report.labels import Box, Label, needs_line, place, spread
from gibench.benchmarks.report.plot_style import (
    BAND,
    FAINT,
    FRONT,
    INK,
    LINES,
    PIXELS_PER_INCH,
    STYLE,
    look,
    save,
    set_log_axis,
    tick_text,
)
from gibench.benchmarks.report.runs import image_part, part_title
from gibench.benchmarks.report.source import ReportSource
from gibench.benchmarks.report.summary import Summary
from gibench.benchmarks.report.tables import stage_times
from gibench.benchmarks.report.wording import metric_title, number, printable
from gibench.metrics import METRICS

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PLOTTED = ("rmse_display", "rmse", "dssim", "lpips_alex", "lpips_vgg", "flip")
"""Metrics that get plots of their own: those of the papers' tables and FLIP. The page draws any other."""

WIDTH, HEIGHT = 6.5, 4.4
"""Inches: the width of a page's text, so that the type stays as large as it was set."""

FARTHEST_FLOOR = 30.0
"""A floor this many times below the least error is told in words: shown in its place it would flatten the rest."""

SMALL = 6.8
"""Points: the type of labels."""

ATTEMPTS = 12
"""How often a plot is made taller, by a quarter each, so that all names find a place."""

LONGEST_LABEL = 48
"""Characters of a name in a plot, which is about 130 of them wide."""

NOISE_BELOW = "noise floor, off the axis"


@dataclass(frozen=True)
class Cost:
    """What an error is plotted against.

    column: of the summary's entries. name: in file names. title: of the plot. axis: what the axis says. unit: what
    the column is divided by. timed: whether values of two machines must not meet in one plot.
    """

    column: str
    name: str
    title: str
    axis: str
    unit: float = 1.0
    timed: bool = True


COSTS = (
    Cost("ms_median", "time", "time per frame", "milliseconds per frame (median)"),
    Cost("prepare_s", "preparation", "preparation time", "seconds of preparation a room"),
    Cost("bytes", "bytes", "size on disk", "baked for a room, MB", unit=1e6, timed=False),
)


def write_plots(source: ReportSource, summary: Summary, out: Path) -> list[Path]:
    """Write every plot as SVG and PNG into a folder; times of different machines never share one."""
    import matplotlib

    with matplotlib.rc_context(STYLE):
        return _written(source, summary, out)


def _written(source: ReportSource, summary: Summary, out: Path) -> list[Path]:
    written: list[Path] = []
    for track in summary.tracks:
        prefix = f"{track}-" if len(summary.tracks) > 1 else ""
        for part in (part for part in summary.parts if part == image_part(part)):
            for metric in plotted_metrics(summary, part):
                for cost in COSTS:
                    machines = summary.machines if cost.timed else [None]
                    for order, machine in enumerate(machines):
                        figure = error_against(summary, track, part, metric, cost, machine=machine)
                        if figure is not None:
                            name = f"{prefix}error-against-{cost.name}-{part}-{metric}"
                            several = len(machines) > 1
                            written += save(figure, out, f"{name}-machine-{order + 1}" if several else name)
                figure = error_along_path(summary, track, part, metric)
                if figure is not None:
                    written += save(figure, out, f"{prefix}error-along-path-{part}-{metric}")
        for order, machine in enumerate(summary.machines):
            figure = stage_bars(source, summary, track, machine)
            if figure is not None:
                several = len(summary.machines) > 1
                written += save(figure, out, f"{prefix}stages" + (f"-machine-{order + 1}" if several else ""))
    return written


def plotted_metrics(summary: Summary, part: str) -> list[str]:
    """Choose the metrics of a part that get plots: those of `PLOTTED` that are there, else all of single frames."""
    found = summary.metrics(part, in_time=False)
    return [name for name in found if name in PLOTTED] or found


def error_against(
    summary: Summary, track: str, part: str, metric: str, cost: Cost, *, machine: str | None = None
) -> Figure | None:
    """Plot error against a cost: settings of one method joined, 95 % intervals, the Pareto front, the noise floor.

    machine: whose results; None for all. None is returned where fewer than two settings have both numbers, or where
    nothing costs anything.
    """
    points = _points(summary, track, part, metric, cost, machine)
    if len(points) < 2 or not (points["cost"] > 0).any():
        return None
    higher = METRICS[metric].direction == "higher"
    title = f"{metric_title(metric)} against {cost.title}"
    for attempt in range(ATTEMPTS):
        figure, axes = _figure(WIDTH, HEIGHT * 1.25**attempt)
        _title(figure, title, _about(summary, track, part, machine))
        logarithmic = not higher and bool((points["mean"] > 0).all())
        _error_axis(axes, points["low"], points["high"], points["mean"], points["floor"], logarithmic)
        nothing = _cost_axis(axes, points["cost"])
        x = points["cost"].where(points["cost"] > 0, nothing)
        axes.set_xlabel(cost.axis)
        axes.set_ylabel(f"{metric_title(metric)}, {'higher' if higher else 'lower'} is better")
        floor = float(points["floor"].mean())
        _noise_band(axes, floor, higher)
        front = _front(axes, x, points, higher)
        obstacles = [*_curves(axes, x, points, summary), *_along(axes, *front, corners=False)]
        if math.isfinite(floor):
            obstacles += _along(axes, np.array(axes.get_xlim()), np.array([floor, floor]), corners=False)
        if _label(figure, axes, x, points, front, floor, obstacles) or attempt == ATTEMPTS - 1:
            break
    return figure


def _points(
    summary: Summary, track: str, part: str, metric: str, cost: Cost, machine: str | None
) -> pd.DataFrame:
    scores = summary.scores
    scores = scores[(scores["part"] == part) & (scores["metric"] == metric)]
    entries = summary.entries[summary.entries["track"] == track]
    if machine is not None:
        entries = entries[entries["machine"] == machine]
    points = entries.drop(columns="rooms").merge(scores, left_index=True, right_on="entry").set_index("entry")
    points["cost"] = points[cost.column] / cost.unit
    points["whole"] = points["rooms"] == points["rooms"].max()
    return points[np.isfinite(points["cost"]) & np.isfinite(points["mean"])]


def _figure(width: float, height: float) -> tuple[Figure, Axes]:
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(width, height), dpi=PIXELS_PER_INCH)
        FigureCanvasAgg(figure)
        left, right, bottom, top = 0.68, 0.22, 0.5, 0.56
        axes = figure.add_axes(
            (left / width, bottom / height, 1 - (left + right) / width, 1 - (bottom + top) / height)
        )
        axes.grid(True, zorder=0)
        axes.set_axisbelow(True)
    return figure, axes


def _title(figure: Figure, title: str, about: str) -> None:
    height = figure.get_size_inches()[1]
    figure.text(0.015, 1 - 0.09 / height, title, size=10, weight="bold", color=INK, va="top")
    figure.text(0.015, 1 - 0.29 / height, about, size=SMALL, color=FAINT, va="top")


def _about(summary: Summary, track: str, part: str, machine: str | None) -> str:
    rooms = int(summary.entries.loc[summary.entries["track"] == track, "rooms"].max())
    over = (
        f"{rooms} rooms, 95 % intervals over rooms and seeds"
        if rooms > 1
        else "one room, 95 % intervals over its frames"
    )
    words = [part_title(part), f"track {_short(track)}", over]
    if machine:
        words.append(machine if len(machine) < 40 else machine[:38] + "…")
    return "  ·  ".join(words)


def _error_axis(
    axes: Axes, lows: pd.Series, highs: pd.Series, means: pd.Series, floors: pd.Series, logarithmic: bool
) -> None:
    floor = floors[np.isfinite(floors)]
    low, high = float(min(lows.min(), means.min())), float(max(highs.max(), means.max()))
    if logarithmic:
        low = max(low, float(means.min()) / 10)
        # The floor is shown in its place unless that leaves the methods no room.
        if len(floor) and floor.mean() > 0 and floor.mean() > low / FARTHEST_FLOOR:
            low = min(low, float(floor.mean()) / 1.3)
        pad = max((high / low) ** 0.06, 1.05)
        set_log_axis(axes, "y", low / pad, high * pad)
    else:
        low, high = float(min(low, *floor, high)), float(max(high, *floor))
        pad = 0.06 * (high - low) or 0.05 * abs(high) or 1.0
        axes.set_ylim(low - pad, high + pad)


def _cost_axis(axes: Axes, costs: pd.Series) -> float:
    """Make the axis logarithmic, with a place for 0 at its left; give that place."""
    positive = costs[costs > 0]
    low, high = float(positive.min()), float(positive.max())
    pad = max((high / low) ** 0.07, 1.3)
    if (costs > 0).all():
        set_log_axis(axes, "x", low / pad, high * pad)
        return math.nan
    nothing = low / max(3.0, (high / low) ** 0.2)
    set_log_axis(axes, "x", nothing / pad, high * pad, [(nothing, "none")])
    axes.axvline(math.sqrt(nothing * low), color=FAINT, linewidth=0.6, linestyle=(0, (1, 3)), zorder=1)
    return nothing


def _front(axes: Axes, x: pd.Series, points: pd.DataFrame, higher: bool) -> tuple[Any, Any]:
    """Draw the staircase of what no cheaper setting beats, and give its corners.

    Settings that failed in a room are no part of it.
    """
    best = math.inf
    corners: list[tuple[float, float]] = []
    bottom, top = axes.get_ylim()
    for entry in x[points["whole"]].sort_values(kind="stable").index:
        value = -points["mean"][entry] if higher else points["mean"][entry]
        if value < best:
            corners.append((float(x[entry]), corners[-1][1] if corners else (bottom if higher else top)))
            corners.append((float(x[entry]), float(points["mean"][entry])))
            best = value
    corners.append((axes.get_xlim()[1], corners[-1][1]))
    across, up = np.array(corners).T
    axes.plot(across, up, color=FRONT, linewidth=2.6, solid_joinstyle="miter", zorder=1.5)
    return across, up


def _curves(axes: Axes, x: pd.Series, points: pd.DataFrame, summary: Summary) -> list[Box]:
    """Draw markers, intervals and the lines that join settings; give the places that they take, in pixels."""
    methods = list(summary.entries["method"].unique())
    seen: dict[str, list[str]] = {}
    taken: list[Box] = []
    for curve, own in points.groupby("curve", sort=False):
        own = own.loc[x[own.index].sort_values(kind="stable").index]
        method = own["method"].iloc[0]
        siblings = seen.setdefault(method, [])
        style = look(methods.index(method))
        # A second curve of a method keeps colour and marker, hollow and with another line.
        fill = style["color"] if not siblings else "white"
        line = LINES[len(siblings) % len(LINES)]
        siblings.append(str(curve))
        across, up = x[own.index].to_numpy(), own["mean"].to_numpy()
        spans = np.abs(np.stack([own["low"], own["high"]]) - up)
        axes.errorbar(
            across, up, yerr=spans, fmt="none", ecolor=style["color"], elinewidth=0.9, capsize=1.8, zorder=3
        )
        axes.plot(across, up, color=style["color"], linewidth=1.1, linestyle=line, zorder=3)
        axes.plot(
            across,
            up,
            linestyle="none",
            marker=style["marker"],
            markersize=5,
            color=style["color"],
            markerfacecolor=fill,
            zorder=4,
        )
        taken += _along(axes, across, up)
        for at, low, high in zip(across, own["low"], own["high"], strict=True):
            taken += _along(axes, np.array([at, at]), np.array([low, high]))
    return taken


def _along(axes: Axes, across: Any, up: Any, *, corners: bool = True) -> list[Box]:
    """Cover a line by small boxes, in pixels, with larger ones at its corners where markers are."""
    scale = PIXELS_PER_INCH / 72
    bottom = axes.get_ylim()[0]
    ends = axes.transData.transform(np.column_stack([across, np.maximum(up, bottom)]))
    half = 3.2 * scale if corners else scale
    boxes = [Box(a - half, b - half, a + half, b + half) for a, b in ends]
    for first, last in itertools.pairwise(ends):
        for share in np.linspace(0, 1, max(2, int(np.hypot(*(last - first)) / (5 * scale)))):
            a, b = first + share * (last - first)
            boxes.append(Box(a - scale, b - scale, a + scale, b + scale))
    return boxes


def _label(
    figure: Figure,
    axes: Axes,
    x: pd.Series,
    points: pd.DataFrame,
    front: tuple[Any, Any],
    floor: float,
    obstacles: list[Box],
) -> bool:
    """Name every curve beside it, and its settings where there is room. False where a name found no place.

    Names without a place are left out: of hundreds of settings the tables tell.
    """
    scale = PIXELS_PER_INCH / 72
    wanted: list[tuple[str, Any, bool]] = []
    pixels = axes.transData.transform(np.column_stack([x, points["mean"]]))
    where: dict[Any, Any] = dict(zip(points.index, pixels, strict=True))
    # The front is named in the middle of its longest step.
    steps = axes.transData.transform(np.column_stack(front))
    longest = int(np.argmax(np.abs(np.diff(steps[:, 0])) + np.abs(np.diff(steps[:, 1]))))
    where["front"] = (steps[longest] + steps[longest + 1]) / 2
    wanted.append(("Pareto front", "front", True))
    if math.isfinite(floor):
        bottom, top = axes.get_ylim()
        shown = min(max(floor, bottom), top)
        off = "" if bottom < floor < top else ", off the axis"
        where["floor"] = axes.transData.transform((axes.get_xlim()[1], shown)) - (2 * scale, 0)
        wanted.append((f"noise floor of the reference, {tick_text(floor)}{off}", "floor", True))
    for curve, own in points.groupby("curve", sort=False):
        missing = not own["whole"].all()
        note = " (not all rooms)" if missing else ""
        if len(own) == 1:
            wanted.append((f"{_short(own['label'].iloc[0])}{note}", own.index[0], True))
            continue
        others = [where[entry] for entry in points.index if entry not in own.index] or [np.zeros(2)]
        free = {entry: min(np.hypot(*(where[entry] - other)) for other in others) for entry in own.index}
        wanted.append((f"{_short(str(curve))}{note}", max(free, key=lambda entry: free[entry]), True))
        wanted += [(str(step), entry, False) for entry, step in own["step"].items() if step]
    made = [
        figure.text(
            0,
            0,
            words,
            size=SMALL if required else SMALL - 0.9,
            color=INK if required and entry not in ("front", "floor") else FAINT,
        )
        for words, entry, required in wanted
    ]
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    sizes = [text.get_window_extent(renderer) for text in made]
    labels = [
        Label(float(where[entry][0]), float(where[entry][1]), size.width, size.height, required)
        for (_, entry, required), size in zip(wanted, sizes, strict=True)
    ]
    frame = axes.get_window_extent(renderer)
    bounds = Box(frame.x0 + scale, frame.y0 + scale, frame.x1 - scale, frame.y1 - scale)
    boxes = place(labels, obstacles, bounds, scale=scale)
    complete = True
    for text, label, box, size in zip(made, labels, boxes, sizes, strict=True):
        if box is None:
            text.remove()
            complete &= not label.required
            continue
        # The window extent begins below the text's baseline by its descent, which differs from text to text.
        at = figure.transFigure.inverted().transform((box.left - size.x0, box.bottom - size.y0))
        text.set_position((float(at[0]), float(at[1])))
        if needs_line(label, box, scale):
            ends = [(label.x, label.y), box.nearest(label.x, label.y)]
            _leader(figure, figure.transFigure.inverted().transform(ends))
    return complete


def _leader(figure: Figure, ends: Any, colour: str = FAINT) -> None:
    from matplotlib.lines import Line2D

    figure.add_artist(
        Line2D(ends[:, 0], ends[:, 1], color=colour, linewidth=0.5, transform=figure.transFigure)
    )


def error_along_path(summary: Summary, track: str, part: str, metric: str) -> Figure | None:
    """Plot error frame by frame, a panel a room, for the best setting of each method; None without such frames."""
    from matplotlib.ticker import MaxNLocator

    chosen = best_settings(summary, track, part, metric)
    values = summary.values
    values = values[(values["part"] == part) & (values["metric"] == metric) & (values["frame"] >= 0)]
    values = values[values["entry"].isin(chosen) & np.isfinite(values["value"])]
    scenes = sorted(values["scene"].unique())
    if not scenes:
        return None
    higher = METRICS[metric].direction == "higher"
    methods = list(summary.entries["method"].unique())
    panel = max(1.45, 0.125 * (len(chosen) + 1))
    margin, gap = 0.95, 0.42
    height = margin + len(scenes) * (panel + gap)
    figure, first = _figure(WIDTH, height)
    first.remove()
    names = [_entry_name(summary, entry) for entry in chosen]
    right = _widest(figure, [*names, NOISE_BELOW]) + 0.3
    title = f"{metric_title(metric)} along the path, the best setting of each method"
    _title(figure, title, f"{part_title(part)}  ·  track {track}")
    for order, scene in enumerate(scenes):
        bottom = height - 0.62 - (order + 1) * (panel + gap) + gap - 0.1
        axes = _panel(figure, (0.68, bottom, WIDTH - 0.68 - right, panel))
        own = values[values["scene"] == scene]
        floor = summary.floor
        floor = floor[(floor["scene"] == scene) & (floor["part"] == part) & (floor["metric"] == metric)]
        level = float(floor.loc[np.isfinite(floor["value"]), "value"].mean())
        logarithmic = not higher and bool((own["value"] > 0).all())
        _error_axis(axes, own["value"], own["value"], own["value"], floor["value"], logarithmic)
        _noise_band(axes, level, higher)
        frames = sorted(own["frame"].unique())
        axes.set_xlim(frames[0] - 0.5, frames[-1] + 0.5)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.set_title(scene, size=8, pad=3, loc="left")
        if order == len(scenes) - 1:
            axes.set_xlabel("frame of the path")
        ends: list[tuple[str, float, str]] = []
        for entry in chosen:
            line = own[own["entry"] == entry].sort_values("frame")
            if line.empty:
                continue
            style = look(methods.index(summary.entries.loc[entry, "method"]))
            axes.plot(
                line["frame"],
                line["value"],
                color=style["color"],
                linestyle=style["linestyle"],
                marker=style["marker"],
                markersize=3.2,
                markevery=max(1, len(line) // 8),
                linewidth=1.1,
                zorder=3,
            )
            ends.append((_entry_name(summary, entry), float(line["value"].iloc[-1]), style["color"]))
        if math.isfinite(level):
            low, high = axes.get_ylim()
            ends.append(("noise floor" if low < level < high else NOISE_BELOW, level, FAINT))
        _end_labels(figure, axes, ends)
    figure.text(
        0.012,
        0.5,
        f"{metric_title(metric)}, {'higher' if higher else 'lower'} is better",
        rotation=90,
        va="center",
        size=8.5,
        color=INK,
    )
    return figure


def best_settings(summary: Summary, track: str, part: str, metric: str) -> list[Any]:
    """Give the entry of each method whose mean is best, among those that did not fail in any room where there are."""
    scores = summary.scores[(summary.scores["part"] == part) & (summary.scores["metric"] == metric)]
    scores = scores[np.isfinite(scores["mean"])].set_index("entry")
    better: Callable[[pd.Series], Any] = (
        (lambda means: means.idxmin())
        if METRICS[metric].direction == "lower"
        else (lambda means: means.idxmax())
    )
    chosen = []
    of = summary.entries[summary.entries["track"] == track]
    for _, own in of.groupby("method", sort=False):
        found = scores.loc[[entry for entry in own.index if entry in scores.index]]
        if len(found):
            chosen.append(better(found.loc[found["rooms"] == found["rooms"].max(), "mean"]))
    return chosen


def _entry_name(summary: Summary, entry: Any) -> str:
    return _short(str(summary.entries.loc[entry, "label"]))


def _short(label: str) -> str:
    """Cut what would fill a plot: its begin and its end tell settings of one method apart, the tables say all of it."""
    label = printable(" ".join(label.split()))
    return label if len(label) <= LONGEST_LABEL else f"{label[: LONGEST_LABEL - 20]} … {label[-17:]}"


def _widest(figure: Figure, texts: Sequence[str]) -> float:
    """Measure the widest of some labels, in inches."""
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    made = [figure.text(0, 0, text, size=SMALL) for text in texts]
    widest = max(text.get_window_extent(renderer).width for text in made)
    for text in made:
        text.remove()
    return float(widest) / PIXELS_PER_INCH


def _panel(figure: Figure, inches: tuple[float, float, float, float]) -> Axes:
    import matplotlib

    width, height = figure.get_size_inches()
    left, bottom, across, up = inches
    with matplotlib.rc_context(STYLE):
        axes = figure.add_axes((left / width, bottom / height, across / width, up / height))
        axes.grid(True)
        axes.set_axisbelow(True)
    return axes


def _noise_band(axes: Axes, floor: float, higher: bool) -> None:
    """Draw the band in which the reference's own noise hides every difference."""
    if not math.isfinite(floor):
        return
    bottom, top = axes.get_ylim()
    shown = min(max(floor, bottom), top)
    axes.axhspan(*((shown, top) if higher else (bottom, shown)), color=BAND, zorder=0.5, linewidth=0)
    if bottom < floor < top:
        axes.axhline(floor, color=FAINT, linewidth=0.9, linestyle=(0, (4, 2)), zorder=1)


def _end_labels(figure: Figure, axes: Axes, ends: Sequence[tuple[str, float, str]]) -> None:
    """Write the name of each line to the right of its end, moved apart, with a line from one to the other."""
    scale = PIXELS_PER_INCH / 72
    right = axes.get_xlim()[1]
    bottom, top = axes.get_ylim()
    pixels = [axes.transData.transform((right, min(max(value, bottom), top))) for _, value, _ in ends]
    low, high = (axes.transAxes.transform((0, share))[1] for share in (0, 1))
    heights = spread([float(at[1]) for at in pixels], 8.4 * scale, low, high)
    inverse = figure.transFigure.inverted()
    for (name, _, colour), (edge, at), y in zip(ends, pixels, heights, strict=True):
        start, end = (edge + 2 * scale, at), (edge + 14 * scale, y)
        _leader(figure, inverse.transform([start, end]), colour)
        x, height = inverse.transform((edge + 16 * scale, y))
        figure.text(x, height, name, size=SMALL, color=INK, va="center_baseline")


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
    row, top, bottom = 0.17, 0.78, 0.42
    names = [_entry_name(summary, entry) for entry in times.index]
    height = top + bottom + row * len(times)
    figure, first = _figure(WIDTH, height)
    first.remove()
    left = _widest(figure, names) + 0.2
    about = f"track {track}  ·  medians over the path, means over rooms; numbers are milliseconds"
    _title(figure, "Where the time of a frame goes", about if len(machine) > 40 else f"{about}  ·  {machine}")
    columns = [*times.columns, "frame"]
    width = (WIDTH - left - 0.1) / len(columns)
    for position, column in enumerate(columns):
        axes = _panel(figure, (left + position * width, bottom, width * 0.92, row * len(times)))
        axes.grid(False)
        axes.set_ylim(len(times) - 0.5, -0.5)
        axes.set_xlim(0, 1)
        axes.tick_params(length=0)
        axes.spines[["bottom", "left"]].set_visible(False)
        axes.set_yticks(range(len(times)), names if position == 0 else [], size=SMALL)
        axes.set_xticks([])
        axes.set_title(_short(column), size=SMALL, pad=3, loc="left")
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
    figure.text(
        left / WIDTH,
        0.16 / height,
        "bar: share of the frame; half a column is all of it",
        size=SMALL,
        color=FAINT,
    )
    return figure
