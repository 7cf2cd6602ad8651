"""Cases, and the list of all."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

SUBJECTS = (
    "materials",
    "lights",
    "geometry",
    "cameras",
    "numbers",
    "methods",
    "coverings",
    "statistics",
    "speed",
)
"""Modules of this package that hold cases, in the order of the table."""

PARTS = (
    "light",
    "error bars",
    "surface",
    "files",
    "checks",
    "denoiser",
    "lightmap",
    "probes",
    "methods",
    "metrics",
    "run",
)
"""Parts of the system, the columns of the table.

light: the factorized path tracer. error bars: `color_se`. surface: surface, reflection, curvature and motion channels.
files: what is stored, and read again. checks: bad input is refused, by a named error. denoiser: Open Image Denoise.
lightmap, probes: what methods bake and look up. methods: what they make of it. metrics: error measures, tone mapping.
run: only where a case ended before its end.
"""

PASS, KNOWN, MENDED, FAIL = "pass", "known", "mended", "FAIL"
"""Verdicts: within the bound; beyond it, for a reason that is listed; listed, yet within it; beyond it."""


@dataclass(frozen=True)
class Check:
    """Finding of a case about one part of the system.

    part: one of PARTS. what: the error that was measured, in words. error, bound: ≥ 0, in the same unit; relative
    unless `what` names one. source: where the bound comes from. known: why the bound is not kept, where that is not
    ours to mend.
    """

    part: str
    what: str
    error: float
    bound: float
    source: str
    known: str = ""

    def __post_init__(self) -> None:
        """Refuse a part that no column shows."""
        if self.part not in PARTS:
            raise ValueError(f"there is no part {self.part!r} of the system: {', '.join(PARTS)}")

    @property
    def verdict(self) -> str:
        """One of the verdicts. What is not finite is beyond any bound."""
        kept = math.isfinite(self.error) and math.isfinite(self.bound) and self.error <= self.bound
        if self.known:
            return MENDED if kept else KNOWN
        return PASS if kept else FAIL


@dataclass(frozen=True)
class Curve:
    """Measurements that a case leaves beside its checks, to be written as CSV and drawn. rows: column → value."""

    name: str
    rows: tuple[dict[str, Any], ...]


Found = Iterator[Check | Curve]


@dataclass(frozen=True)
class Case:
    """One hard case.

    name: no other case has it. run: yields its checks; None where only the case's name has reached another process.
    quick: whether it is part of the subset that CI runs.
    """

    subject: str
    name: str
    run: Callable[[], Found] | None
    quick: bool


_CASES: list[Case] = []


def case(
    name: str, *, quick: bool | Sequence[Any] = False, **values: Sequence[Any]
) -> Callable[[Callable[..., Found]], Callable[..., Found]]:
    """Enter a function as a case, or as one case for each value of a parameter.

    name: with {parameter} in it where there is one. quick: True, or the values that belong to the quick subset.
    values: at most one parameter with the values that it takes.
    """

    def enter(function: Callable[..., Found]) -> Callable[..., Found]:
        subject = function.__module__.rpartition(".")[2]
        if not values:
            _CASES.append(Case(subject, name, function, bool(quick)))
            return function
        ((parameter, taken),) = values.items()
        for value in taken:
            belongs = quick if isinstance(quick, bool) else value in quick

            def run(value: Any = value) -> Found:
                return function(**{parameter: value})

            _CASES.append(Case(subject, name.format(**{parameter: value}), run, belongs))
        return function

    return enter


def all_cases() -> tuple[Case, ...]:
    """Every case, by subject. Imports the modules of all of them, but no renderer."""
    for subject in SUBJECTS:
        importlib.import_module(f"gibench.stress.{subject}")
    return tuple(sorted(_CASES, key=lambda one: SUBJECTS.index(one.subject)))
