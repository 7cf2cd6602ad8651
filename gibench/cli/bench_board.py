"""Output of `gibench bench board`: the leaderboard of a run, in 80 columns or as Markdown."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from gibench.benchmarks import statistics
from gibench.benchmarks.results import Results
from gibench.cli.bench_printing import LABEL
from gibench.cli.output import cut, one_line, say
from gibench.cli.progress import duration

if TYPE_CHECKING:
    import pandas as pd

WIDTH = 80
"""Columns of a terminal."""


def print_board(results: Results, name: str | None = None, part: str = "full") -> None:
    """Print the leaderboard by one metric, the first of the track where none is named, with intervals and costs."""
    if name is None and results.frames.empty:
        return
    name = name or results.run["metrics"][0]
    board = statistics.leaderboard(results, name, part)
    several = len(set(board["machine"])) > 1
    say(f"\n{'method':<{LABEL}} {name:>9} {'95 % interval':>17} {'ms':>8} {'prepared':>10}")
    for row in board.to_dict("records"):
        if math.isnan(row["mean"]):
            say(f"{cut(row['label'], LABEL):<{LABEL}}    {_nothing(row)}")
            continue
        machine = f" {row['machine'][:6]}" if several else ""
        say(
            f"{cut(row['label'], LABEL):<{LABEL}} {row['mean']:9.4f} {row['low']:8.4f} {row['high']:8.4f} "
            f"{row['ms']:8.1f} {duration(row['prepare_s']):>10}{machine}"
        )
    _remarks(results, board)
    noise = statistics.floor(results, name, part)
    truly = name in results.unbiased
    if math.isfinite(noise):
        what = "(the references themselves)" if truly else "(noise of the references)"
        say(f"{what:<{LABEL}} {noise:9.4f}")
    if truly:
        say(f"{name} is against the truth, by samples of references that are not denoised.")


def print_columns(
    results: Results, names: Sequence[str], parts: Sequence[str], *, markdown: bool = False
) -> None:
    """Print means by several metrics, a column each with its parts side by side, best first by the first of both.

    What a setting has no number for is a dash. In a terminal columns that do not fit stand in further tables below.
    """
    boards = {(name, part): statistics.leaderboard(results, name, part) for name in names for part in parts}
    first = boards[names[0], parts[0]]
    cells = {
        key: {(row["label"], row["machine"]): row["mean"] for row in board.to_dict("records")}
        for key, board in boards.items()
    }
    several = len(set(first["machine"])) > 1
    heads = ["method", *names, "ms"]
    rows = []
    for row in first.to_dict("records"):
        key = (row["label"], row["machine"])
        means = [" / ".join(_number(cells[name, part][key]) for part in parts) for name in names]
        label = one_line(row["label"]) + (f" {row['machine'][:6]}" if several else "")
        rows.append([label, *means, _number(row["ms"])])
    if len(parts) > 1:
        say(f"{' / '.join(parts)}\n")
    if markdown:
        say(f"| {' | '.join(heads)} |\n| --- |{' ---: |' * (len(heads) - 1)}")
        for cell in rows:
            say(f"| {' | '.join(_escaped(text) for text in cell)} |")
    else:
        _say_in_tables(heads, rows)
    _remarks(results, first)


def _remarks(results: Results, board: pd.DataFrame) -> None:
    """Say what rows must not be read without."""
    if len(set(board["machine"])) > 1:
        _wrapped("Results of several machines: compare times within the rows of one alone.")
    most = board["rooms"].max()
    for row in board[(board["rooms"] > 0) & (board["rooms"] < most)].to_dict("records"):
        why = "others failed" if row["failed"] else "it was not run in the others"
        _wrapped(f"{one_line(row['label'])} is over {row['rooms']} of {most} rooms: {why}.")
    labels = set(board["label"])
    for label in (label for label in results.mixed if label in labels):
        _wrapped(mixed(label))


def mixed(label: str) -> str:
    """What there is to say of a row that several versions made; see `Results.mixed`."""
    text = "has results of several versions of its code, knobs or training time: run its command again."
    return f"{one_line(label)} {text}"


def _wrapped(text: str) -> None:
    for line in textwrap.wrap(text, WIDTH):
        say(line)


def _say_in_tables(heads: list[str], rows: list[list[str]]) -> None:
    widths = [max(map(len, column)) for column in zip(heads, *rows, strict=True)]
    at = 1
    while at < len(heads):
        end, used = at, LABEL
        while end < len(heads) and (end == at or used + 1 + widths[end] <= WIDTH):
            used += 1 + widths[end]
            end += 1
        if at > 1:
            say("")
        for cell in (heads, *rows):
            columns = (f"{text:>{width}}" for text, width in zip(cell[at:end], widths[at:end], strict=True))
            say(f"{cut(cell[0], LABEL):<{LABEL}} {' '.join(columns)}")
        at = end


def _number(value: float) -> str:
    return f"{value:#.4g}".rstrip(".") if math.isfinite(value) else "-"


def _escaped(text: str) -> str:
    return text.replace("|", "\\|")


def _nothing(row: Mapping[Any, Any]) -> str:
    return f"failed in all {row['failed']} results" if row["failed"] else "no such value"
