"""The cases of `gibench stress`, as tests: the quick subset always, all of them with `pytest -m stress`."""

from __future__ import annotations

import subprocess
import sys
import warnings

import pytest

from gibench.stress.registry import FAIL, MENDED, SUBJECTS, Check, all_cases
from gibench.stress.running import rows_of

CASES = all_cases()


@pytest.mark.parametrize(
    "case",
    [pytest.param(one, id=one.name, marks=() if one.quick else pytest.mark.stress) for one in CASES],
)
def test_case(case):
    checks = [row.check for row in rows_of(case) if hasattr(row, "check")]
    assert checks
    for check in checks:
        if check.verdict == MENDED:
            warnings.warn(f"{case.name}: {check.what} is listed as known, and passes here", stacklevel=1)
    assert [check for check in checks if check.verdict == FAIL] == []


def test_every_case_has_a_name_of_its_own_and_a_subject():
    names = [one.name for one in CASES]
    assert len(set(names)) == len(names)
    assert {one.subject for one in CASES} == set(SUBJECTS)


def test_listing_the_cases_loads_neither_mitsuba_nor_torch():
    code = (
        "import sys; from gibench.stress.registry import all_cases; all_cases(); "
        "print(sorted({'mitsuba', 'drjit', 'torch'} & set(sys.modules)))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert result.stdout.strip() == "[]", result.stdout + result.stderr


def test_every_subject_but_speed_has_a_quick_case():
    assert {one.subject for one in CASES if one.quick} == set(SUBJECTS) - {"speed"}


@pytest.mark.parametrize(
    ("error", "bound", "known", "verdict"),
    [
        (0.0, 0.0, "", "pass"),
        (0.1, 0.2, "", "pass"),
        (0.3, 0.2, "", "FAIL"),
        (0.3, 0.2, "a reason", "known"),
        (0.1, 0.2, "a reason", "mended"),
        (float("nan"), 0.2, "", "FAIL"),
        (float("inf"), float("inf"), "", "FAIL"),
        (0.1, float("nan"), "", "FAIL"),
        (float("nan"), 0.2, "a reason", "known"),
    ],
)
def test_verdicts(error, bound, known, verdict):
    assert Check("light", "", error, bound, "", known).verdict == verdict


def test_a_part_that_no_column_shows_is_refused():
    with pytest.raises(ValueError, match="dark"):
        Check("dark", "", 0, 0, "")


def test_there_are_enough():
    assert len(CASES) >= 60
