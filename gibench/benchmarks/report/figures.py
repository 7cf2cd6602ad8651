"""Shared by plots: figures, panels, titles, axes of error, noise floors, names at the ends of lines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gibench.benchmarks.report.labels import spread
from gibench.benchmarks.report.plot_style import BAND, FAINT, INK, PIXELS_PER_INCH, STYLE, set_log_axis
from gibench.benchmarks.report.summary import Summary
from gibench.benchmarks.report.wording import printable

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 6.5
"""Inches: the width of a page's text, so that the type stays as large as it was set."""

FARTHEST_FLOOR = 30.0
"""A floor this many times below the least error is told in words: shown in its place it would flatten the rest."""

SMALL = 6.8
"""Points: the type of labels."""

BETWEEN = "  ·  "
"""Between what is said of a plot below its title."""

LONGEST_LABEL = 48
"""Characters of a name in a plot, which is about 130 of them wide."""


def new_figure(width: float, height: float) -> tuple[Figure, Axes]:
    """A figure of so many inches, and axes that leave room for a title and what axes say."""
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


def new_panel(figure: Figure, inches: tuple[float, float, float, float]) -> Axes:
    """Axes in a figure. inches: left, bottom, width, height."""
    import matplotlib

    width, height = figure.get_size_inches()
    left, bottom, across, up = inches
    with matplotlib.rc_context(STYLE):
        axes = figure.add_axes((left / width, bottom / height, across / width, up / height))
        axes.grid(True)
        axes.set_axisbelow(True)
    return axes


def write_title(figure: Figure, title: str, about: str) -> None:
    """Write a title, and below it in small type what the plot is about, in two lines where one is too short."""
    width, height = figure.get_size_inches()
    figure.text(0.015, 1 - 0.09 / height, title, size=10, weight="bold", color=INK, va="top")
    words = about.split(BETWEEN)
    first = len(words)
    while first > 1 and widest(figure, [BETWEEN.join(words[:first])]) > 0.97 * width:
        first -= 1
    lines = [BETWEEN.join(some) for some in (words[:first], words[first:]) if some]
    for number, line in enumerate(lines):
        figure.text(0.015, 1 - (0.29 + 0.12 * number) / height, line, size=SMALL, color=FAINT, va="top")


def lowest_shown(means: pd.Series, logarithmic: bool) -> float:
    """The smallest error that an axis makes room for."""
    return float(means.min()) / 10 if logarithmic else -math.inf


def without_longest(points: pd.DataFrame, lowest: float) -> pd.DataFrame:
    """Points with `low` and `high` NaN where an interval begins below the smallest error that is shown.

    On a logarithmic axis those of two rooms, thirteen standard errors wide, would cover everything else.
    """
    fits = points["low"] >= lowest
    return points.assign(low=points["low"].where(fits), high=points["high"].where(fits))


def about_intervals(lows: pd.Series, lowest: float) -> str:
    """What the line below a title says of intervals that are left out; "" where none is."""
    return f"{BETWEEN}intervals that leave the axis are not drawn" if (lows < lowest).any() else ""


def error_axis(
    axes: Axes, lows: pd.Series, highs: pd.Series, means: pd.Series, floors: pd.Series, logarithmic: bool
) -> None:
    """Make the axis of errors hold means and intervals, and the noise floor where that leaves them room."""
    floor = floors[np.isfinite(floors)]
    low, high = float(np.nanmin([*lows, *means])), float(np.nanmax([*highs, *means]))
    if logarithmic:
        low = max(low, lowest_shown(means, logarithmic))
        # The floor is shown in its place unless that leaves the methods no room.
        if len(floor) and floor.mean() > 0 and floor.mean() > low / FARTHEST_FLOOR:
            low = min(low, float(floor.mean()) / 1.3)
        pad = max((high / low) ** 0.06, 1.05)
        set_log_axis(axes, "y", low / pad, high * pad)
    else:
        low, high = float(min([low, high, *floor])), float(max([high, *floor]))
        pad = 0.06 * (high - low) or 0.05 * abs(high) or 1.0
        axes.set_ylim(low - pad, high + pad)


def cost_axis(axes: Axes, costs: pd.Series, zero: str = "none") -> float:
    """Make the axis logarithmic, with a place for 0 at its left, called `zero`; give that place, NaN without any."""
    positive = costs[costs > 0]
    low, high = float(positive.min()), float(positive.max())
    pad = max((high / low) ** 0.07, 1.3)
    if (costs > 0).all():
        set_log_axis(axes, "x", low / pad, high * pad)
        return math.nan
    nothing = low / max(3.0, (high / low) ** 0.2)
    set_log_axis(axes, "x", nothing / pad, high * pad, [(nothing, zero)])
    axes.axvline(math.sqrt(nothing * low), color=FAINT, linewidth=0.6, linestyle=(0, (1, 3)), zorder=1)
    return nothing


def noise_band(axes: Axes, floor: float, higher: bool) -> None:
    """Draw the band in which the reference's own noise hides every difference."""
    if not math.isfinite(floor):
        return
    bottom, top = axes.get_ylim()
    shown = min(max(floor, bottom), top)
    axes.axhspan(*((shown, top) if higher else (bottom, shown)), color=BAND, zorder=0.5, linewidth=0)
    if bottom < floor < top:
        axes.axhline(floor, color=FAINT, linewidth=0.9, linestyle=(0, (4, 2)), zorder=1)


def end_labels(figure: Figure, axes: Axes, ends: Sequence[tuple[str, float, str]]) -> None:
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
        leader(figure, inverse.transform([start, end]), colour)
        x, height = inverse.transform((edge + 16 * scale, y))
        figure.text(x, height, name, size=SMALL, color=INK, va="center_baseline")


def leader(figure: Figure, ends: Any, colour: str = FAINT) -> None:
    """Draw a thin line between two places of a figure, (2, 2)."""
    from matplotlib.lines import Line2D

    figure.add_artist(
        Line2D(ends[:, 0], ends[:, 1], color=colour, linewidth=0.5, transform=figure.transFigure)
    )


def widest(figure: Figure, texts: Sequence[str]) -> float:
    """Measure the widest of some labels, in inches."""
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    made = [figure.text(0, 0, text, size=SMALL) for text in texts]
    widest = max(text.get_window_extent(renderer).width for text in made)
    for text in made:
        text.remove()
    return float(widest) / PIXELS_PER_INCH


def entry_name(summary: Summary, entry: Any) -> str:
    """The label of a setting, short."""
    return short(str(summary.entries.loc[entry, "label"]))


def short(label: str) -> str:
    """Cut what would fill a plot: its begin and its end tell settings of one method apart, the tables say all of it."""
    label = printable(" ".join(label.split()))
    return label if len(label) <= LONGEST_LABEL else f"{label[: LONGEST_LABEL - 20]} … {label[-17:]}"
