"""Plots of a run, and the names of their files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from gibench.benchmarks.report.error_against_cost import COSTS, error_against
from gibench.benchmarks.report.error_against_settings import error_against_settings
from gibench.benchmarks.report.error_against_training import error_against_training
from gibench.benchmarks.report.error_along_path import error_along_path
from gibench.benchmarks.report.plot_style import STYLE, save
from gibench.benchmarks.report.runs import image_part
from gibench.benchmarks.report.source import ReportSource
from gibench.benchmarks.report.stage_bars import stage_bars
from gibench.benchmarks.report.summary import Summary
from gibench.benchmarks.report.trainings import trainings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PLOTTED = ("rmse_display", "rmse", "dssim", "lpips_alex", "lpips_vgg", "flip")
"""Metrics that get plots of their own: those of the papers' tables and FLIP. The page draws any other."""


def write_plots(source: ReportSource, summary: Summary, out: Path) -> list[Path]:
    """Write every plot as SVG and PNG into a folder; times of different machines never share one."""
    import matplotlib

    with matplotlib.rc_context(STYLE):
        drawn = _figures(source, summary)
        return [path for name, figure in drawn if figure is not None for path in save(figure, out, name)]


def _figures(source: ReportSource, summary: Summary) -> Iterator[tuple[str, Figure | None]]:
    """All plots with the names of their files; None for one that would be empty."""
    several = len(summary.machines) > 1
    machines = [
        (one, f"-machine-{order + 1}" if several else "") for order, one in enumerate(summary.machines)
    ]
    curves = trainings(source, summary)
    for track in summary.tracks:
        prefix = f"{track}-" if len(summary.tracks) > 1 else ""
        for part in (part for part in summary.parts if part == image_part(part)):
            for metric in plotted_metrics(summary, part):
                of = f"{part}-{metric}"
                for cost in COSTS:
                    for machine, suffix in machines if cost.timed else [(None, "")]:
                        figure = error_against(summary, track, part, metric, cost, machine=machine)
                        yield f"{prefix}error-against-{cost.name}-{of}{suffix}", figure
                for machine, suffix in machines:
                    figure = error_against_settings(summary, track, part, metric, machine)
                    yield f"{prefix}error-against-settings-{of}{suffix}", figure
                yield f"{prefix}error-along-path-{of}", error_along_path(summary, track, part, metric)
        for machine, suffix in machines:
            yield f"{prefix}stages{suffix}", stage_bars(source, summary, track, machine)
            yield f"{prefix}training-curves{suffix}", error_against_training(curves, summary, track, machine)


def plotted_metrics(summary: Summary, part: str) -> list[str]:
    """Choose the metrics of a part that get plots: those of `PLOTTED` that are there, else all of single frames."""
    found = summary.metrics(part, in_time=False)
    return [name for name in found if name in PLOTTED] or found
