"""The plot of a curve of speed against error."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gibench.benchmarks.report.plot_style import FAINT, STYLE, look, set_log_axis
from gibench.stress.registry import Curve

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH, HEIGHT = 6.5, 4.2
"""Inches."""


def plot(curve: Curve) -> Figure:
    """Error against seconds a frame, both logarithmic; one line a setting, its samples written beside it.

    curve: with columns place, setting, spp, relmse and seconds.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        for position, setting in enumerate(dict.fromkeys(row["setting"] for row in curve.rows)):
            rows = [row for row in curve.rows if row["setting"] == setting and row["relmse"] > 0]
            x, y = [row["seconds"] for row in rows], [row["relmse"] for row in rows]
            axes.plot(x, y, label=setting, linewidth=1.2, markersize=4, **look(position))
            for row in rows:
                axes.annotate(
                    f"{row['spp']}",
                    (row["seconds"], row["relmse"]),
                    xytext=(4, 3) if position % 2 == 0 else (-4, -8),
                    ha="left" if position % 2 == 0 else "right",
                    textcoords="offset points",
                    fontsize=6.5,
                    color=FAINT,
                )
        times = [row["seconds"] for row in curve.rows]
        errors = [row["relmse"] for row in curve.rows if row["relmse"] > 0]
        set_log_axis(axes, "x", min(times) / 1.3, max(times) * 1.5)
        set_log_axis(axes, "y", min(errors) / 1.5, max(errors) * 1.5)
        axes.grid(True)
        axes.set_xlabel("seconds a frame (samples a pixel beside each point)")
        axes.set_ylabel("relMSE, exposed")
        axes.set_title(f"Speed against error, {curve.rows[0]['place']}")
        axes.legend(frameon=False)
    return figure
