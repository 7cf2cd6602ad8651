import re
import shutil
import subprocess

import pytest

from gibench.benchmarks.report.summary import summarise
from gibench.benchmarks.report.tables import Cell, Table, tables, write_tables
from tests.benchmarks.report.synthetic import SyntheticRun


@pytest.fixture(scope="module")
def made(run, summary):
    return tables(run, summary)


def body(table):
    return [[cell.text for cell in row] for _, rows in table.groups for row in rows]


def test_the_papers_tables_are_there_and_what_failed(made):
    assert set(made) == {
        *("errors-full", "errors-full-by-scene", "errors-specular", "errors-specular-by-scene"),
        *("preparation", "frame-time", "failed"),
    }
    assert body(made["failed"]) == [["ulr", "room-000002", "1", "MemoryError: <b>no</b> room"]]
    assert "1 of 33 results failed" in made["failed"].caption


def test_the_best_of_a_column_is_bold_and_best(made, summary):
    table = made["errors-full"]
    names = {"RMSE": "rmse", "PSNR (dB)": "psnr", "FLIP": "flip"}
    for column, title in enumerate(table.head):
        bold = [row[0].text for _, rows in table.groups for row in rows if row[column].best]
        if title not in names:
            continue
        scores = summary.scores[
            (summary.scores["part"] == "full") & (summary.scores["metric"] == names[title])
        ].set_index("entry")
        whole = scores[scores["rooms"] == 3]["mean"]
        best = whole.idxmax() if title.startswith("PSNR") else whole.idxmin()
        assert bold == [summary.entries.loc[best, "label"]]


def test_a_setting_that_failed_in_a_room_is_marked_and_is_never_the_best(run):
    quick = SyntheticRun(run.root, frames=1, failed=("path-traced spp=16 oidn",))
    table = tables(quick, summarise(quick))["errors-full"]
    (row,) = [row for row in table.groups[0][1] if row[0].text.startswith("path-traced spp=16 oidn")]
    assert row[0].text.endswith("(2 of 3 rooms)")
    assert not any(cell.best for cell in row)


def test_preparation_and_frame_times_stand_in_their_columns(made):
    prepared = {row[0]: row for row in body(made["preparation"])}
    assert made["preparation"].head[1:5] == ["Lightmap", "Probes", "References", "Training"]
    assert prepared["nearest-probe"][1:6] == ["44.0 s", "5.50 min", "–", "–", "6.23 min"]
    times = {row[0]: row for row in body(made["frame-time"])}
    head = made["frame-time"].head
    assert head[1:4] == ["G-buffer", "Ray casting", "Search"]
    assert times["isg"][head.index("Gather")] == "22.0"
    assert times["isg"][head.index("Frame")] == "33.0"
    assert times["isg"][head.index("Search")] == "–"


def test_several_machines_are_told_apart_and_warned_about(run):
    two = SyntheticRun(run.root, frames=1, scenes=1, machines=("m-one", "m-two"))
    found = tables(two, summarise(two))["frame-time"]
    assert "must not be compared" in found.caption
    assert {row[0] for row in body(found)} >= {"rtrt on m-one", "rtrt on m-two"}


def test_markdown_has_one_width_and_escapes_its_bars():
    table = Table("About.", ["A", "B"], [("g", [[Cell("x|y", best=True)], [Cell("z")]])], words=2)
    assert table.markdown() == "About.\n\n| A | B |\n| --- | --- |\n| g | **x\\|y** |\n|  | z |\n"


def test_latex_escapes_what_it_would_read_as_a_command():
    text = Table("50 % of #1_a", ["A"], [(None, [[Cell("\\x & {y} ~ ^")]])]).latex()
    assert r"\caption{50 \% of \#1\_a}" in text
    assert r"\textbackslash{}x \& \{y\} \textasciitilde{} \textasciicircum{} \\" in text


def test_every_table_is_written_twice_and_latex_is_balanced(run, summary, tmp_path):
    for path in write_tables(run, summary, tmp_path):
        text = path.read_text()
        assert text.endswith("\n")
        if path.suffix == ".tex":
            rows = [line for line in text.splitlines() if line.endswith(r"\\")]
            columns = len(re.search(r"\\begin\{tabular\}\{([lr]+)\}", text)[1])
            assert {len(re.findall(r"(?<!\\)&", row)) + 1 for row in rows} == {columns}
    assert {path.suffix for path in tmp_path.iterdir()} == {".md", ".tex"}


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no pdflatex")
def test_latex_compiles(run, summary, tmp_path):
    write_tables(run, summary, tmp_path)
    inputs = "\n".join(rf"\input{{{path.name}}}" for path in sorted(tmp_path.glob("*.tex")))
    (tmp_path / "all.tex").write_text(
        "\\documentclass{article}\\usepackage{booktabs}\\begin{document}\n" + inputs + "\n\\end{document}\n"
    )
    done = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "all.tex"],
        cwd=tmp_path,
        capture_output=True,
    )
    assert done.returncode == 0, done.stdout[-2000:]
