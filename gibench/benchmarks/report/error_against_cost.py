"""The plots of error against a cost: time per frame, preparation, size on disk."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from gibench.benchmarks.report.figures import (
    BETWEEN,
    SMALL,
    WIDTH,
    about_intervals,
    cost_axis,
    error_axis,
    leader,
    lowest_shown,
    new_figure,
    noise_band,
    short,
    without_longest,
    write_title,
)
from gibench.benchmarks.report.labels import Box, Label, needs_line, place
from gibench.benchmarks.report.plot_style import (
    FAINT,
    FRONT,
    INK,
    LINES,
    PIXELS_PER_INCH,
    look,
    tick_text,
)
from gibench.benchmarks.report.runs import part_title
from gibench.benchmarks.report.summary import Summary
from gibench.benchmarks.report.wording import metric_title
from gibench.metrics import METRICS

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HEIGHT = 4.4
"""Inches."""

ATTEMPTS = 12
"""Times that a plot is made taller, by a quarter each, so that all names find a place."""


@dataclass(frozen=True)
class Cost:
    """A cost that an error is plotted against.

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
    logarithmic = not higher and bool((points["mean"] > 0).all())
    lowest = lowest_shown(points["mean"], logarithmic)
    about = _about(summary, track, part, machine) + about_intervals(points["low"], lowest)
    points = without_longest(points, lowest)
    for attempt in range(ATTEMPTS):
        figure, axes = new_figure(WIDTH, HEIGHT * 1.25**attempt)
        write_title(figure, title, about)
        error_axis(axes, points["low"], points["high"], points["mean"], points["floor"], logarithmic)
        nothing = cost_axis(axes, points["cost"])
        x = points["cost"].where(points["cost"] > 0, nothing)
        axes.set_xlabel(cost.axis)
        axes.set_ylabel(f"{metric_title(metric)}, {'higher' if higher else 'lower'} is better")
        floor = float(points["floor"].mean())
        noise_band(axes, floor, higher)
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
    points = summary.points(track, part, metric, machine)
    points = points.assign(
        cost=points[cost.column] / cost.unit, whole=points["rooms"] == points["rooms"].max()
    )
    return points[np.isfinite(points["cost"])]


def _about(summary: Summary, track: str, part: str, machine: str | None) -> str:
    rooms = int(summary.entries.loc[summary.entries["track"] == track, "rooms"].max())
    over = (
        f"{rooms} rooms, 95 % intervals over rooms and seeds"
        if rooms > 1
        else "one room, 95 % intervals over its frames"
    )
    words = [part_title(part), f"track {short(track)}", over]
    if machine:
        words.append(machine if len(machine) < 40 else machine[:38] + "…")
    return BETWEEN.join(words)


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
            if math.isfinite(low) and math.isfinite(high):
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
            wanted.append((f"{short(own['label'].iloc[0])}{note}", own.index[0], True))
            continue
        others = [where[entry] for entry in points.index if entry not in own.index] or [np.zeros(2)]
        free = {entry: min(np.hypot(*(where[entry] - other)) for other in others) for entry in own.index}
        wanted.append((f"{short(str(curve))}{note}", max(free, key=lambda entry: free[entry]), True))
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
            leader(figure, figure.transFigure.inverted().transform(ends))
    return complete
