"""The plot of held-out error against training time and steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gibench.benchmarks.report.figures import (
    BETWEEN,
    SMALL,
    WIDTH,
    cost_axis,
    end_labels,
    error_axis,
    new_figure,
    new_panel,
    short,
    widest,
    write_title,
)
from gibench.benchmarks.report.plot_style import FAINT, INK, LINES, look
from gibench.benchmarks.report.summary import Summary
from gibench.benchmarks.report.trainings import TrainingCurve
from gibench.benchmarks.report.wording import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

AXES = (("seconds", "seconds of training, looks included"), ("steps", "steps of training"))
"""Costs that error is plotted against, a column each, with the titles of their axes."""

CAPTION = (
    "Held-out errors are each method's own measure in its own space: heights compare within a row, never between rows.",
    "0: the untrained network.  Marker: the weights that are kept.  ×: an error that was not finite.",
)


def error_against_training(
    curves: Sequence[TrainingCurve], summary: Summary, track: str, machine: str
) -> Figure | None:
    """Plot held-out error, a line a training, a row a method with its ablations; None without trainings.

    curves: all of the run (`gibench.benchmarks.report.trainings`). Rows share their axes of time and of steps, and no
    axis of error: what is held out, and how it is measured, is each method's own.
    """
    curves = [curve for curve in curves if curve.track == track and curve.machine == machine]
    if not curves:
        return None
    families = list(dict.fromkeys(curve.family for curve in curves))
    rows = [[curve for curve in curves if curve.family == family] for family in families]
    names = [list(dict.fromkeys(curve.name for curve in row)) for row in rows]
    heights = [max(1.35, 0.125 * (len(own) + 1)) for own in names]
    top, bottom, gap = 0.78, 0.78, 0.48
    height = top + sum(heights) + gap * (len(rows) - 1) + bottom
    figure, first = new_figure(WIDTH, height)
    first.remove()
    named = [short(name) for own in names if len(own) > 1 for name in own]
    right = widest(figure, named) + 0.3 if named else 0.15
    left, between = 0.72, 0.22
    write_title(
        figure,
        "Held-out error against training time and steps",
        BETWEEN.join([f"track {short(track)}", "a line a training", short(machine)]),
    )
    width = (WIDTH - left - between - right) / len(AXES)
    methods = list(summary.entries["method"].unique())
    under = height - top
    for row, own, up, family in zip(rows, names, heights, families, strict=True):
        under -= up
        panels = [
            new_panel(figure, (left + column * (width + between), under, width, up))
            for column in range(len(AXES))
        ]
        _title(panels[0], family, own, len(row))
        for axes, (what, words) in zip(panels, AXES, strict=True):
            _error(axes, row)
            places = _places(axes, [getattr(curve, what) for curve in curves], curves)
            at = {id(curve): x for curve, x in zip(curves, places, strict=True)}
            for curve in row:
                style = look(methods.index(curve.method))
                alike = [name for name in own if _method_of(row, name) == curve.method]
                several = sum(other.name == curve.name for other in row) > 1
                _line(axes, at[id(curve)], curve, style, LINES[alike.index(curve.name) % len(LINES)], several)
            if row is rows[-1]:
                axes.set_xlabel(words)
        panels[1].set_yticklabels([])
        if len(own) > 1:
            end_labels(figure, panels[1], _ends(row, own, methods))
        under -= gap
    for line, text in enumerate(CAPTION):
        figure.text(0.015, (0.3 - 0.14 * line) / height, text, size=SMALL, color=FAINT, va="top")
    middle = (bottom + height - top) / 2 / height
    figure.text(
        0.012,
        middle,
        "held-out error, own measure",
        rotation=90,
        va="center",
        size=SMALL if len(rows) == 1 else 8.5,
        color=INK,
    )
    return figure


def _title(axes: Axes, family: str, names: list[str], count: int) -> None:
    name = short(names[0]) if len(names) == 1 else printable(family)
    axes.set_title(f"{name}, {count} trainings" if count > 1 else name, size=8, pad=3, loc="left")


def _method_of(row: list[TrainingCurve], name: str) -> str:
    return next(curve.method for curve in row if curve.name == name)


def _error(axes: Axes, row: list[TrainingCurve]) -> None:
    import pandas as pd

    errors = pd.Series(np.concatenate([curve.errors for curve in row])).dropna()
    if errors.empty:
        axes.set_ylim(0, 1)
        axes.set_yticks([])
        return
    error_axis(axes, errors, errors, errors, pd.Series(dtype=float), bool((errors > 0).all()))


def _places(axes: Axes, values: list[NDArray[Any]], curves: list[TrainingCurve]) -> list[NDArray[np.float64]]:
    """Lay out the axis for the looks of all rows, and give the place of each: what is untrained stands at 0."""
    import pandas as pd

    costs = [
        np.where(curve.steps > 0, np.maximum(own, 0.0), 0.0)
        for own, curve in zip(values, curves, strict=True)
    ]
    flat = np.concatenate(costs)
    if not (flat > 0).any():
        axes.set_xlim(-1, 1)
        axes.set_xticks([0], ["0"])
        return costs
    nothing = cost_axis(axes, pd.Series(flat), "0")
    return [np.where(own > 0, own, nothing) for own in costs]


def _line(
    axes: Axes, x: NDArray[np.float64], curve: TrainingCurve, style: dict[str, Any], line: Any, several: bool
) -> None:
    colour, errors = style["color"], curve.errors
    finite = np.isfinite(errors)
    axes.plot(
        x,
        errors,
        color=colour,
        linestyle=line,
        linewidth=0.7 if several else 1.1,
        alpha=0.7 if several else 1.0,
        zorder=3,
    )
    # Between two that are not finite a look has no line.
    alone = finite & ~np.r_[False, finite[:-1]] & ~np.r_[finite[1:], False]
    axes.plot(x[alone], errors[alone], color=colour, linestyle="none", marker=".", markersize=3, zorder=3)
    if curve.best is not None:
        axes.plot(
            x[curve.best],
            errors[curve.best],
            color=colour,
            linestyle="none",
            marker=style["marker"],
            markersize=2.6 if several else 4,
            zorder=4,
        )
    axes.plot(
        x[~finite],
        np.ones((~finite).sum()),
        color=colour,
        linestyle="none",
        marker="x",
        markersize=3.4,
        markeredgewidth=0.8,
        transform=axes.get_xaxis_transform(),
        clip_on=False,
        zorder=4,
    )


def _ends(row: list[TrainingCurve], names: list[str], methods: list[str]) -> list[tuple[str, float, str]]:
    """Name, height and colour where the lines of each setting end: in the middle of its trainings."""
    ends = []
    for name in names:
        own = [curve for curve in row if curve.name == name]
        last = [curve.errors[np.isfinite(curve.errors)][-1] for curve in own if curve.best is not None]
        colour = look(methods.index(own[0].method))["color"]
        # A setting without any finite error is named at the top, where its crosses are.
        ends.append((short(name), float(np.median(last)) if last else math.inf, colour))
    return ends
