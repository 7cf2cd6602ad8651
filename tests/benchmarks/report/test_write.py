import subprocess
import sys

import pytest

from gibench.benchmarks.report import ReportError, write_report
from tests.benchmarks.report.synthetic import SyntheticRun, settings


def test_a_report_is_all_of_it(tmp_path):
    run = SyntheticRun(
        tmp_path, chosen=settings()[:4], scenes=2, frames=2, metrics=("rmse",), failed=("ulr",)
    )
    out = tmp_path / "deep" / "report"
    assert write_report(run, out, against="isg") == out / "index.html"
    for name in ("leaderboard.csv", "frames.csv", "stages.csv", "tables/errors-full.tex", "tables/failed.md"):
        assert (out / name).stat().st_size
    for name in ("error-against-time-full-rmse", "error-along-path-specular-rmse", "stages"):
        for suffix in (".svg", ".png"):
            assert (out / "plots" / f"{name}{suffix}").stat().st_size
    assert len(list(out.glob("images/*/*.js"))) == len(list(out.glob("errors/*/*.js"))) + 2 * 2 * 2
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    write_report(run, out, against="isg")
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


def test_bad_input_writes_nothing(tmp_path):
    run = SyntheticRun(tmp_path, chosen=settings()[:1], scenes=1, frames=1)
    with pytest.raises(ReportError, match="no result is labelled 'nothing'"):
        write_report(run, tmp_path / "out", against="nothing")
    assert not (tmp_path / "out").exists()


def test_without_the_extra_it_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "jinja2", None)
    run = SyntheticRun(tmp_path, chosen=settings()[:1], scenes=1, frames=1)
    with pytest.raises(ReportError, match=r"needs jinja2: pip install 'gibench\[bench\]'"):
        write_report(run, tmp_path / "out")


def test_importing_the_report_is_light():
    code = (
        "import sys, gibench.benchmarks.report; "
        "print(sorted({'mitsuba', 'torch', 'matplotlib', 'jinja2', 'pandas'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout.strip() == "[]", done.stderr


def test_what_a_report_of_before_left_is_gone(tmp_path):
    chosen = settings()[:3]
    failing = SyntheticRun(tmp_path, chosen=chosen, scenes=2, frames=1, metrics=("rmse",), failed=("ulr",))
    out = tmp_path / "report"
    out.mkdir()
    (out / "tables").mkdir()
    mine = out / "tables" / "mine.md"
    mine.write_text("of somebody who chose this folder")
    write_report(failing, out)
    assert mine.exists()
    assert (out / "tables/failed.md").exists()
    fewer = SyntheticRun(tmp_path, chosen=chosen[:1], scenes=1, frames=1, metrics=("rmse",), parts=("full",))
    write_report(fewer, out)
    written = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
    write_report(fewer, tmp_path / "new")
    new = {
        path.relative_to(tmp_path / "new").as_posix()
        for path in (tmp_path / "new").rglob("*")
        if path.is_file()
    }
    assert written == new | {"tables/mine.md"}
    assert len(list(out.glob("images/*"))) == 2
