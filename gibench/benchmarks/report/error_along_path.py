"""The plot of error frame by frame."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from gibench.benchmarks.report.figures import (
    BETWEEN,
    WIDTH,
    end_labels,
    entry_name,
    error_axis,
    new_figure,
    new_panel,
    noise_band,
    widest,
    write_title,
)
from gibench.benchmarks.report.plot_style import FAINT, INK, look
from gibench.benchmarks.report.runs import part_title
from gibench.benchmarks.report.summary import Summary
from gibench.benchmarks.report.wording import metric_title
from gibench.metrics import METRICS

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

NOISE_BELOW = "noise floor, off the axis"


def error_along_path(summary: Summary, track: str, part: str, metric: str) -> Figure | None:
    """Plot error frame by frame, a panel a room, for the best setting of each method; None without such frames.

    A sequence is a line. Stills follow nothing: they are points, without a line.
    """
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
    figure, first = new_figure(WIDTH, height)
    first.remove()
    names = [entry_name(summary, entry) for entry in chosen]
    right = widest(figure, [*names, NOISE_BELOW]) + 0.3
    of_scene = summary.paths[summary.paths["scene"].isin(scenes)]
    sequences = dict(
        zip(zip(of_scene["scene"], of_scene["frame"], strict=True), of_scene["sequence"], strict=True)
    )
    where = "along the path" if any(sequences.values()) else "of each still"
    title = f"{metric_title(metric)} {where}, the best setting of each method"
    write_title(figure, title, f"{part_title(part)}{BETWEEN}track {track}")
    for order, scene in enumerate(scenes):
        bottom = height - 0.62 - (order + 1) * (panel + gap) + gap - 0.1
        axes = new_panel(figure, (0.68, bottom, WIDTH - 0.68 - right, panel))
        own = values[values["scene"] == scene]
        floor = summary.floor
        floor = floor[(floor["scene"] == scene) & (floor["part"] == part) & (floor["metric"] == metric)]
        level = float(floor.loc[np.isfinite(floor["value"]), "value"].mean())
        logarithmic = not higher and bool((own["value"] > 0).all())
        error_axis(axes, own["value"], own["value"], own["value"], floor["value"], logarithmic)
        noise_band(axes, level, higher)
        frames = sorted(own["frame"].unique())
        axes.set_xlim(frames[0] - 0.5, frames[-1] + 0.5)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.set_title(scene, size=8, pad=3, loc="left")
        if order == len(scenes) - 1:
            axes.set_xlabel("frame of the path" if all(sequences.values()) else "frame; a point is a still")
        ends: list[tuple[str, float, str]] = []
        for entry in chosen:
            line = own[own["entry"] == entry].sort_values("frame")
            if line.empty:
                continue
            style = look(methods.index(summary.entries.loc[entry, "method"]))
            following = line["frame"].map(lambda frame, scene=scene: sequences.get((scene, frame), ""))
            for sequence, stretch in line.groupby(following, sort=False):
                axes.plot(
                    stretch["frame"],
                    stretch["value"],
                    color=style["color"],
                    linestyle=style["linestyle"] if sequence else "none",
                    marker=style["marker"],
                    markersize=3.2,
                    markevery=max(1, len(stretch) // 8) if sequence else 1,
                    linewidth=1.1,
                    zorder=3,
                )
            ends.append((entry_name(summary, entry), float(line["value"].iloc[-1]), style["color"]))
        if math.isfinite(level):
            low, high = axes.get_ylim()
            ends.append(("noise floor" if low < level < high else NOISE_BELOW, level, FAINT))
        end_labels(figure, axes, ends)
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
