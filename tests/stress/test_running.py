"""What `gibench stress` does with cases: rows, crashes, files, the exit code."""

from __future__ import annotations

import csv
import os

import pytest

from gibench.cli import run as run_command
from gibench.cli.app import app
from gibench.stress import registry, running
from gibench.stress.registry import Case, Check, Curve
from gibench.stress.running import Report, Row, rows_of
from gibench.stress.tables import COLUMNS, markdown, write_tables
from tests.one_processor import needs_affinity, run_on_one_processor

SUBJECT = registry.SUBJECTS[0]


def made(name, *found):
    return Case(SUBJECT, name, lambda: iter(found), quick=True)


def good():
    return Check("light", "radiance", 0.1, 0.2, "theory")


def bad():
    return Check("files", "half | float", 0.3, 0.2, "theory")


def known():
    return Check("light", "radiance", 0.3, 0.2, "theory", known="the renderer's own limit")


def raising():
    yield good()
    raise ZeroDivisionError("no such number")


def crashing():
    yield good()
    os._exit(7)


# By name, since the process that runs them imports this module anew.
TOYS = (
    made("good", good(), Curve("curve", ({"x": 1},))),
    Case(SUBJECT, "crash", crashing, quick=True),
    made("bad", bad()),
    Case(SUBJECT, "known", lambda: iter((known(),)), quick=False),
)


def work_on_toys(connection, quick, only, done):
    running.all_cases = lambda: TOYS
    running._work(connection, quick, only, done)


@pytest.fixture
def toys(monkeypatch):
    monkeypatch.setattr(running, "_work", work_on_toys)


def test_what_a_case_raises_is_a_failed_row_beside_what_it_found():
    rows = list(rows_of(Case(SUBJECT, "raises", raising, quick=True)))
    assert [row.check.verdict for row in rows] == ["pass", "FAIL"]
    assert rows[1].check.part == "run"
    assert rows[1].check.what == "ZeroDivisionError: no such number"


def test_a_crash_is_a_row_and_the_others_go_on(toys):
    counts = []
    report = running.run(on_case=lambda *count: counts.append(count))
    assert [(row.case, row.check.verdict) for row in report.rows] == [
        ("good", "pass"),
        ("crash", "pass"),
        ("crash", "FAIL"),
        ("bad", "FAIL"),
        ("known", "known"),
    ]
    assert "code 7" in report.rows[2].check.what
    assert [curve.name for curve in report.curves] == ["curve"]
    assert report.cases == 4
    assert counts[-1] == (4, 4)


def test_quick_and_only_choose(toys):
    assert {row.case for row in running.run(quick=True).rows} == {"good", "crash", "bad"}
    assert {row.case for row in running.run(only="no").rows} == {"known"}
    with pytest.raises(running.StressError, match="'nothing'"):
        running.run(only="nothing")


def test_the_files_say_all_and_the_code_is_that_of_the_verdicts(toys, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("gibench.stress.pictures.write_pictures", lambda report, out: [])
    assert run_command(app, ["stress", "--out", str(tmp_path / "all")]) == 1
    said = capsys.readouterr()
    assert "2 of 5 checks failed" in said.err
    assert "FAIL: bad: files: half | float: 0.3 where 0.2 is the bound" in said.out
    assert max(map(len, said.out.splitlines()[:-1])) <= 80
    with open(tmp_path / "all/stress.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == COLUMNS
    assert [row["verdict"] for row in rows] == ["pass", "pass", "FAIL", "FAIL", "known"]
    assert (tmp_path / "all/curve.csv").read_text() == "x\n1\n"
    assert run_command(app, ["stress", "--only", "known", "--out", str(tmp_path / "known")]) == 0
    assert "known: known: light" in capsys.readouterr().out


def test_markdown_escapes_and_lists_reasons():
    rows = tuple(Row(SUBJECT, "case", check, 0.5) for check in (good(), bad(), known()))
    text = markdown(Report(rows, (), 1, 1.0))
    assert "half \\| float" in text
    assert "- case: the renderer's own limit." in text
    assert "1 cases, 3 checks: 1 pass, 1 known, 1 FAIL" in text


def test_a_picture_shows_every_case(tmp_path):
    pytest.importorskip("matplotlib")
    from gibench.stress.pictures import write_pictures

    rows = tuple(Row(SUBJECT, f"case {n}", check, 0.5) for n, check in enumerate((good(), bad(), known())))
    rows += (Row(SUBJECT, "crash", running.ended("it raised"), 0.1),)
    svg, png = write_pictures(Report(rows, (), 4, 1.0), tmp_path)
    assert png.stat().st_size > 1000
    for text in ("case 0", "case 1", "case 2", "crash"):
        assert text in svg.read_text().replace("<!-- ", "")


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setattr(running, "NEEDED", ("no_such_package",))
    with pytest.raises(running.StressError, match="no_such_package"):
        running.run()


def test_an_empty_table_is_a_table(tmp_path):
    write_tables(Report((), (), 0, 0.0), tmp_path)
    assert (tmp_path / "stress.csv").read_text().strip() == ",".join(COLUMNS)


@needs_affinity
def test_rooms_of_materials_are_made_on_one_processor(tmp_path):
    """Mitsuba's writer of OpenEXR never returns where it may use one thread only."""
    run_on_one_processor(
        "import pathlib\n"
        "from gibench.rendering.backend import select_variant; select_variant('auto')\n"
        "from gibench.stress import coverings\n"
        f"coverings.room(coverings.MATERIALS['bump'], pathlib.Path({str(tmp_path)!r}))"
    )
