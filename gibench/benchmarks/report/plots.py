"""Plots of a run, and the names of their files."""

from __future__ import annotations

from pathlib import Path

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

PLOTTED = ("rmse_display", "rmse", "dssim", "lpips_alex", "lpips_vgg", "flip")
"""Metrics that get plots of their own: those of the papers' tables and FLIP. The page draws any other."""


def write_plots(source: ReportSource, summary: Summary, out: Path) -> list[Path]:
    """Write every plot as SVG and PNG into a folder; times of different machines never share one."""
    import matplotlib

    with matplotlib.rc_context(STYLE):
        return _written(source, summary, out)


def _written(source: ReportSource, summary: Summary, out: Path) -> list[Path]:
    written: list[Path] = []
    curves = trainings(source, summary)
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
                for order, machine in enumerate(summary.machines):
                    figure = error_against_settings(summary, track, part, metric, machine)
                    if figure is not None:
                        name = f"{prefix}error-against-settings-{part}-{metric}"
                        several = len(summary.machines) > 1
                        written += save(figure, out, f"{name}-machine-{order + 1}" if several else name)
                figure = error_along_path(summary, track, part, metric)
                if figure is not None:
                    written += save(figure, out, f"{prefix}error-along-path-{part}-{metric}")
        for order, machine in enumerate(summary.machines):
            suffix = f"-machine-{order + 1}" if len(summary.machines) > 1 else ""
            for name, figure in (
                ("stages", stage_bars(source, summary, track, machine)),
                ("training-curves", error_against_training(curves, summary, track, machine)),
            ):
                if figure is not None:
                    written += save(figure, out, f"{prefix}{name}{suffix}")
    return written


def plotted_metrics(summary: Summary, part: str) -> list[str]:
    """Choose the metrics of a part that get plots: those of `PLOTTED` that are there, else all of single frames."""
    found = summary.metrics(part, in_time=False)
    return [name for name in found if name in PLOTTED] or found
