"""Style of plots: colours, markers and lines that print in grey and that the colour-blind tell apart, and axes."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gibench.benchmarks.report.wording import number
from gibench.datasets.files import write_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe & Ito 2008, Color universal design, without its yellow, which is too light for thin lines on white."""

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "p")
LINES = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1.2, 1, 1.2)), (0, (8, 1.5)))
"""The three cycles have lengths without common factors, so that 280 methods differ."""

INK, FAINT, BAND, FRONT = "#1a1a1a", "#6e6e6e", "#e9e9e9", "#d2d2d2"

PIXELS_PER_INCH = 200

STYLE: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8,
    "axes.titlesize": 9,
    "axes.labelsize": 8.5,
    "axes.edgecolor": FAINT,
    "axes.linewidth": 0.6,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlelocation": "left",
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "text.color": INK,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.5,
    "text.parse_math": False,  # a dollar in somebody's label is a dollar
    "svg.hashsalt": "gibench",  # the same plot is the same file
}


def look(position: int) -> dict[str, Any]:
    """Give colour, marker and line style of the n-th method."""
    return {
        "color": COLOURS[position % len(COLOURS)],
        "marker": MARKERS[position % len(MARKERS)],
        "linestyle": LINES[position % len(LINES)],
    }


def log_ticks(low: float, high: float) -> list[float]:
    """Choose ticks on a logarithmic axis: round numbers, three to nine of them where that can be.

    low, high: the ends of the axis, 0 < low < high.
    """
    for digits in ((1,), (1, 3), (1, 2, 5), (1, 1.5, 2, 3, 5, 7)):
        ticks = [
            digit * 10.0**power
            for power in range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
            for digit in digits
            if low <= digit * 10.0**power <= high
        ]
        if len(ticks) >= 3:
            return ticks[:: math.ceil(len(ticks) / 9)]
    # Over less than a factor of about three the axis is nearly even: even steps.
    power = 10.0 ** math.floor(math.log10((high - low) / 4))
    step = next(digit * power for digit in (1, 2, 5, 10) if digit * power >= (high - low) / 4)
    return [count * step for count in range(math.ceil(low / step), math.floor(high / step) + 1)]


def set_log_axis(
    axes: Axes, which: str, low: float, high: float, extra: Sequence[tuple[float, str]] = ()
) -> None:
    """Make one axis logarithmic from low to high, with round ticks written out, and extra ones."""
    from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator

    axis = axes.xaxis if which == "x" else axes.yaxis
    (axes.set_xscale if which == "x" else axes.set_yscale)("log")
    (axes.set_xlim if which == "x" else axes.set_ylim)(low, high)
    above = max((at for at, _ in extra), default=0.0)
    ticks = [tick for tick in log_ticks(low, high) if tick > 1.5 * above]
    axis.set_major_locator(FixedLocator([*(at for at, _ in extra), *ticks]))
    axis.set_minor_locator(NullLocator())
    # 0.1 and 10 rather than 0.100 and 10.0: what is round is written short.
    axis.set_major_formatter(FixedFormatter([*(text for _, text in extra), *map(tick_text, ticks)]))


def tick_text(value: float) -> str:
    """Write a round number without the zeros at its end."""
    text = number(value, 3)
    return text.rstrip("0").rstrip(".") if "." in text and "e" not in text else text


def save(figure: Figure, out: Path, name: str) -> list[Path]:
    """Write a figure as <name>.svg and <name>.png, without the date, so that equal plots are equal files."""
    import matplotlib

    written = []
    for suffix, options in (
        (".svg", {"metadata": {"Date": None}}),
        (".png", {"dpi": PIXELS_PER_INCH, "metadata": {"Software": None}}),
    ):
        content = io.BytesIO()
        with matplotlib.rc_context(STYLE):
            figure.savefig(content, format=suffix[1:], **options)
        write_whole(out / f"{name}{suffix}", content.getvalue())
        written.append(out / f"{name}{suffix}")
    return written
