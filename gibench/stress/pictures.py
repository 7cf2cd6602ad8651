"""The table of a run as one picture, cases down and parts of the system across."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from gibench.benchmarks.report.plot_style import FAINT, INK, STYLE, save
from gibench.stress.curves import plot
from gibench.stress.registry import FAIL, KNOWN, MENDED, PARTS
from gibench.stress.running import Report, Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROW_HEIGHT, LEFT, CELL = 0.165, 3.3, 0.62
"""Inches."""

LEAST = 1e-3
"""Share of a bound below which all cells look alike."""

COLOURS = {FAIL: "#D55E00", KNOWN: "#E69F00", MENDED: "#56B4E9"}


def write_pictures(report: Report, out: Path) -> list[Path]:
    """Write stress.svg and stress.png, and a plot of each curve that there is; returns their paths."""
    written = save(table_picture(report), out, "stress")
    for curve in report.curves:
        written += save(plot(curve), out, curve.name)
    return written


def table_picture(report: Report) -> Figure:
    """One cell for each case and part: the share of the bound that its worst check uses up."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    cases = list(dict.fromkeys((row.subject, row.case) for row in report.rows))
    parts = [part for part in PARTS if any(row.check.part == part for row in report.rows)]
    height = ROW_HEIGHT * (len(cases) + len({subject for subject, _ in cases})) + 0.95
    width = LEFT + CELL * len(parts) + 0.15
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(width, height))
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_xlim(0, width)
        axes.set_ylim(height, 0)
        axes.axis("off")
        for column, part in enumerate(parts):
            axes.text(LEFT + CELL * (column + 0.5), 0.3, part, ha="center", va="center", fontsize=7)
        y, subject = 0.45, ""
        for of, name in cases:
            if of != subject:
                subject = of
                axes.text(0.1, y + ROW_HEIGHT / 2, of.upper(), va="center", fontsize=6.5, color=FAINT)
                y += ROW_HEIGHT
            axes.text(0.2, y + ROW_HEIGHT / 2, name, va="center", fontsize=6.5)
            for column, part in enumerate(parts):
                rows = [r for r in report.rows if (r.subject, r.case, r.check.part) == (of, name, part)]
                if rows:
                    _cell(axes, LEFT + CELL * column, y, max(rows, key=_severity))
            y += ROW_HEIGHT
        legend = (
            "error as a share of its bound, the worst check of a case and part; 0: no error at all.  "
            "Orange: beyond, for a known reason.  Red: beyond."
        )
        axes.text(0.1, y + 0.25, legend, va="center", fontsize=6.5, color=FAINT)
    return figure


def _share(row: Row) -> float:
    check = row.check
    if check.error == 0:
        return 0.0
    return check.error / check.bound if check.bound > 0 and math.isfinite(check.error) else math.inf


def _severity(row: Row) -> tuple[int, float]:
    verdict = row.check.verdict
    return (FAIL, KNOWN, MENDED).index(verdict) - 3 if verdict in COLOURS else -9, _share(row)


def _cell(axes, x: float, y: float, row: Row) -> None:  # type: ignore[no-untyped-def]
    from matplotlib.patches import Rectangle

    share, verdict = _share(row), row.check.verdict
    depth = 0.1 + 0.9 * min(max(1 + math.log10(max(share, LEAST)) / 3, 0.0), 1.0)
    # From next to white to the green of "bluish green" as the bound is used up.
    green = tuple(1 - depth * (1 - channel) * 0.75 for channel in (0.0, 0.62, 0.45))
    axes.add_patch(
        Rectangle(
            (x + 0.02, y + 0.01), CELL - 0.04, ROW_HEIGHT - 0.02, facecolor=COLOURS.get(verdict, green), lw=0
        )
    )
    axes.text(x + CELL / 2, y + ROW_HEIGHT / 2, _text(share), ha="center", va="center", fontsize=6, color=INK)


def _text(share: float) -> str:
    """A share of a bound in at most five signs."""
    if share == 0:
        return "0"
    if share < LEAST:
        return f"<{LEAST:g}".replace("0.", ".")
    if math.isinf(share):
        return "∞"
    if share > 1:
        return f"{share:.0f}×" if share >= 9.5 else f"{share:.1f}×"
    return f"{share:.1g}"
