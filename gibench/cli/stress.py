"""`gibench stress`: hard cases against known answers, and the table of what came out."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gibench.cli.output import say

if TYPE_CHECKING:
    from gibench.stress.running import Report

WIDTH = 80


def stress(
    quick: Annotated[bool, typer.Option("--quick", help="The subset that CI runs, about a minute.")] = False,
    out: Annotated[Path, typer.Option(help="Where the tables and pictures go.")] = Path("results/stress"),
    only: Annotated[
        str, typer.Option(help="Cases with this in their name, such as grazing.", show_default="all")
    ] = "",
) -> None:
    """Run scenes and numbers built to break things, and compare with answers that are known.

    Ends with code 1 where a verdict is FAIL: an error beyond its bound for no known reason.
    """
    from gibench.cli.progress import counting
    from gibench.stress.pictures import write_pictures
    from gibench.stress.running import run
    from gibench.stress.tables import write_tables

    out.mkdir(parents=True, exist_ok=True)
    with counting("cases") as on_case:
        report = run(quick=quick, only=only, on_case=on_case)
    write_tables(report, out)
    write_pictures(report, out)
    tell(report)
    say(f"the table: {out / 'stress.md'}, {out / 'stress.csv'}, {out / 'stress.png'}")
    from gibench.stress.registry import FAIL

    if failed := report.of(FAIL):
        say(f"error: {len(failed)} of {len(report.rows)} checks failed", err=True)
        raise typer.Exit(1)


def tell(report: Report) -> None:
    """Say what did not pass, and how many did."""
    from gibench.stress.registry import FAIL, KNOWN, MENDED
    from gibench.stress.tables import summary

    words = {KNOWN: "known", MENDED: "listed as known, and passes: take it off the list", FAIL: "FAIL"}
    for verdict, said in words.items():
        for row in report.of(verdict):
            check = row.check
            numbers = f"{check.error:.3g} where {check.bound:.3g} is the bound"
            text = f"{said}: {row.case}: {check.part}: {check.what}: {numbers}"
            say(textwrap.fill(text, WIDTH, subsequent_indent="  ", break_on_hyphens=False))
    say(summary(report))
