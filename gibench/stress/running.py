"""Cases one after the other in a process of their own, so that one that crashes is a row of the table, not its end."""

from __future__ import annotations

import gc
import importlib.util
import os
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection

from gibench.errors import GibenchError
from gibench.processes import ChildProcess, ProcessEnded
from gibench.rendering.backend import select_variant
from gibench.stress.registry import Case, Check, Curve, all_cases

NEEDED = ("matplotlib", "torch", "xatlas")
"""Packages that the cases and the pictures import beside the core."""


class StressError(GibenchError):
    """A suite that cannot be run, or whose verdicts are bad."""


@dataclass(frozen=True)
class Row:
    """A check of a case. seconds: of wall time, since the check before it."""

    subject: str
    case: str
    check: Check
    seconds: float


@dataclass(frozen=True)
class Report:
    """All that a run found. rows: in the order of the cases. cases: how many ran. seconds: of wall time."""

    rows: tuple[Row, ...]
    curves: tuple[Curve, ...]
    cases: int
    seconds: float

    def of(self, verdict: str) -> list[Row]:
        """The rows of one verdict."""
        return [row for row in self.rows if row.check.verdict == verdict]


def rows_of(case: Case) -> Iterator[Row | Curve]:
    """Run a case here. What it raises is a row too, of the part "run", which has failed."""
    assert case.run is not None
    select_variant()
    start = time.perf_counter()
    try:
        for found in case.run():
            if isinstance(found, Curve):
                yield found
                continue
            yield Row(case.subject, case.name, found, time.perf_counter() - start)
            start = time.perf_counter()
    except Exception as problem:
        if os.environ.get("GIBENCH_DEBUG"):
            traceback.print_exc()
        what = " ".join(f"{type(problem).__name__}: {problem}".split())
        yield Row(case.subject, case.name, ended(what), time.perf_counter() - start)


def ended(what: str) -> Check:
    """The check that a case fails which did not come to its end."""
    return Check("run", what, float("inf"), 0.0, "no case raises or crashes")


def run(
    *, quick: bool = False, only: str = "", on_case: Callable[[int, int], None] = lambda done, of: None
) -> Report:
    """Run the suite, or its quick subset, or the cases whose names contain `only`.

    on_case: called with how many cases are done, of how many. Raises StressError where a package is missing or no case
    is chosen.
    """
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        raise StressError(
            f"{', '.join(missing)} is missing, which the cases need: pip install 'gibench[bench]'"
        )
    started = time.perf_counter()
    found: list[Row | Curve] = []
    done: list[str] = []
    left: list[Case] | None = None
    while left is None or left:
        try:
            with ChildProcess(_work, quick, only, tuple(done)) as process:
                while True:
                    kind, content = process.receive()
                    if kind == "cases":
                        left = content
                    elif kind == "found":
                        found.append(content)
                    elif kind == "done":
                        assert left is not None
                        done.append(left.pop(0).name)
                        on_case(len(done), len(done) + len(left))
        except ProcessEnded as end:
            if left is None:
                raise StressError(f"the cases cannot be loaded: {end}") from None
            if left:  # it has died in the hands of this one
                died = left.pop(0)
                found.append(Row(died.subject, died.name, ended(str(end)), 0.0))
                done.append(died.name)
    if not done:
        raise StressError(f"no case has '{only}' in its name")
    rows = tuple(one for one in found if isinstance(one, Row))
    curves = tuple(one for one in found if isinstance(one, Curve))
    return Report(rows, curves, len(done), time.perf_counter() - started)


def chosen(quick: bool, only: str) -> list[Case]:
    """The cases that are asked for."""
    return [one for one in all_cases() if (one.quick or not quick) and only in one.name]


def _work(connection: Connection, quick: bool, only: str, done: tuple[str, ...]) -> None:
    """Body of the process: say which cases are left, then run one after the other."""
    left = [one for one in chosen(quick, only) if one.name not in done]
    connection.send(("cases", [replace(one, run=None) for one in left]))
    for one in left:
        for found in rows_of(one):
            connection.send(("found", found))
        connection.send(("done", one.name))
        gc.collect()
