"""`gibench bench …` as a user runs it, and what it says to every mistake."""

import dataclasses
import json
import re
import sys
from importlib.metadata import EntryPoint

import pytest

from gibench.baselines.method import Variant
from gibench.benchmarks import registry
from gibench.benchmarks.track import load_track
from gibench.cli import run
from gibench.cli.app import app
from gibench.cli.bench import _methods
from tests.benchmarks import toys
from tests.benchmarks.conftest import TINY

CONSTANT, PLAIN, WRONG = toys.CONSTANT.method, toys.PLAIN.method, toys.WRONG.method


@pytest.fixture(autouse=True)
def toys_installed(monkeypatch):
    points = [
        EntryPoint(name.lower(), f"{__name__}:{name}", registry.GROUP)
        for name in ("CONSTANT", "PLAIN", "WRONG")
    ]
    points.append(EntryPoint("gone", "no.such.module:METHOD", registry.GROUP))
    offered = registry.registry_of(points)
    monkeypatch.setattr(registry, "installed", lambda: offered)
    for name in ("gibench.cli.bench_printing",):
        if name in sys.modules:
            monkeypatch.setattr(sys.modules[name], "installed", lambda: offered)


def toml(values, place="") -> str:
    """Enough of TOML for a track."""
    lines = [f"{k} = {json.dumps(v)}" for k, v in values.items() if not isinstance(v, dict)]
    text = "\n".join(lines) + "\n"
    for key, inner in values.items():
        if isinstance(inner, dict):
            text += f"[{place}{key}]\n" + toml(inner, f"{place}{key}.")
    return text


@pytest.fixture(scope="session")
def track(tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("track") / "tiny.toml"
    path.write_text(toml(TINY))
    return str(path)


def refused(capsys, *arguments, code: int = 2) -> str:
    assert run(app, ["bench", *map(str, arguments)]) == code
    said = capsys.readouterr()
    last = said.err.splitlines()[-1]
    assert last.startswith("error: ")
    assert "Traceback" not in said.err
    return last


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--track", "walkthru"], r"no track 'walkthru'; did you mean 'walkthrough'\?"),
        (["--equal-time", "inf"], "--equal-time: inf is not allowed; allowed is a number above 0"),
        (["--preset", "smoky"], r"no preset 'smoky'; did you mean 'smoke'\?"),
        (["--methods", "constat"], r"no method 'constat'; did you mean 'constant'\?"),
        (["--methods", ","], r"--methods: ',' names nothing"),
        (["--methods", "gone"], r"entry point 'gone'.*cannot be used: no\.such\.module:METHOD raises"),
        (["--methods", "plain", "--set", "plain.shad=1"], r"plain has no knob 'shad'; known: shade"),
        (["--methods", "plain", "--set", "plain.shade=3"], r"plain: shade = 3 is not allowed"),
        (["--methods", "plain", "--set", "constant.shade=1"], r"--set: no method 'constant' is run"),
        (["--methods", "plain", "--set", "shade"], r"--set: 'shade' is no setting"),
        (["--methods", "plain", "--rooms", "0"], r"--rooms: 0 is not allowed"),
        (["--methods", "plain", "--equal-time", "nan"], r"--equal-time: nan is not allowed"),
        (["--methods", "plain", "--training-seconds", "0"], r"--training-seconds: 0 is not allowed"),
        (["--methods", "plain", "--training-seconds", "inf"], r"training \(inf s\) must be below prepare"),
        (["--methods", "plain", "--seeds", "1,x"], r"--seeds: '1,x' is not allowed"),
        (["--methods", "plain", "--seeds=-1"], r"--seeds: '-1' is not allowed"),
        (["--variant", "cuda"], r"--variant: no variant 'cuda'"),
    ],
)
def test_wrong_options(capsys, tmp_path, track, arguments, says):
    given = ["--track", track, "--preset", "tiny", "--out", tmp_path / "r"]
    for option in ("--track", "--preset"):
        if option in arguments:
            place = given.index(option)
            del given[place : place + 2]
    if arguments[0] == "--preset":
        given[:2] = []
    assert re.search(says, refused(capsys, "run", *given, *arguments))
    assert not (tmp_path / "r").exists()


def test_a_track_with_settings_of_no_method(capsys, tmp_path):
    values = json.loads(json.dumps(TINY))
    values["presets"]["tiny"]["methods"]["constnt"] = {"vary": {"shade": [1.0]}}
    (tmp_path / "t.toml").write_text(toml(values))
    said = refused(capsys, "run", "--track", tmp_path / "t.toml", "--preset", "tiny", "--out", tmp_path / "r")
    assert "has settings for method 'constnt', which is not installed; did you mean 'constant'" in said


@pytest.mark.parametrize("command", ["score", "list", "report"])
def test_what_is_no_folder_of_results(capsys, tmp_path, command):
    more = ["--out", tmp_path / "out"] if command == "report" else []
    said = refused(capsys, command, tmp_path, *more)
    assert "holds no results: it has no run.json; `gibench bench run` makes them" in said
    assert list(tmp_path.iterdir()) == []


def test_a_report_in_one_file_and_out_of_it(capsys, tmp_path, results):
    packed, site = tmp_path / "board.zip", tmp_path / "site"
    assert run(app, ["bench", "report", str(results.root), "--archive", str(packed)]) == 0
    assert capsys.readouterr().out == f"{packed}\n"
    assert run(app, ["bench", "report", str(packed), "--out", str(site)]) == 0
    assert capsys.readouterr().out == f"{site / 'index.html'}\n"
    assert (site / "leaderboard.csv").is_file()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["board.zip", "site"]
    assert "site exists: choose a new folder" in refused(capsys, "report", packed, "--out", site, code=1)
    assert "is a packed report: name it alone" in refused(capsys, "report", packed)
    assert "name a folder with --out, or a file with --archive" in refused(capsys, "report", results.root)


def test_list_says_what_there_is(capsys):
    assert run(app, ["bench", "list"]) == 0
    said = capsys.readouterr()
    assert "track walkthrough: " in said.out
    assert re.search(r"cpu +4 rooms, 24 frames of 320x180, up to 20 training views", said.out)
    assert re.search(r"method constant: A toy .*\(toys; ", said.out)
    assert re.search(r"shade +0\.25 0\.5 \[1\.0\] 2\.0", said.out)
    assert "entry point 'gone'" in said.err
    assert run(app, ["bench", "list", "--track", "walkthrough", "--show"]) == 0
    assert "[presets.cpu.reference]" in capsys.readouterr().out
    assert "--show needs --track" in refused(capsys, "list", "--show")


def test_from_a_run_to_comparisons(capsys, tmp_path, track, scenes_only):
    """On scenes that are there already; the run, its list, its scores, and what it is compared with."""
    common = ["bench", "run", "--track", track, "--preset", "tiny", "--out", str(scenes_only)]
    assert run(app, [*common, "--methods", "constant,plain", "--set", "plain.shade=0.5"]) == 0
    said = capsys.readouterr()
    assert "[3/3] room-000000 plain shade=0.5" in said.err
    assert re.search(r"results +.*\(3, of which 3 new, 0 failed\)", said.out)
    assert re.search(r"harness +.*, \d+\.\d % of the run", said.out)
    lines = said.out.splitlines()
    board = [line.split("  ")[0] for line in lines[next(i for i, x in enumerate(lines) if "95 %" in x) + 1 :]]
    assert board[0] == "constant shade=0.25"
    assert board[-1].startswith("(noise of the references)")
    assert max(map(len, lines[1:])) <= 80

    failing = [*common, "--methods", "wrong", "--set", "wrong.how=nan", "--no-score"]
    assert run(app, failing) == 1
    said = capsys.readouterr().err
    assert re.search(r"failed while rendering: frame 1: color is not finite in 1 of 280", said)
    assert said.splitlines()[-1].startswith("error: 1 results failed, `gibench bench list")
    assert run(app, ["bench", "list", str(scenes_only)]) == 0
    assert "4 results, 1 failed" in capsys.readouterr().out

    assert run(app, ["bench", "score", str(scenes_only), "--metrics", "psnr"]) == 0
    assert "4 files of scores written" in capsys.readouterr().out

    assert run(app, ["bench", "compare", "--in", str(scenes_only), "constant shade=0.25", "plain"]) == 0
    said = capsys.readouterr().out
    assert re.search(r"rmse full +-0\.2\d .* better$", said, re.M)
    assert re.search(r"rmse specular +not compared: ", said)
    assert re.search(r"psnr full +[+-]", said)  # none of the track's
    assert max(map(len, said.splitlines())) <= 80
    assert re.search(r"times +\d+\.\d and \d+\.\d ms, prepared in", said)
    within = ["bench", "compare", "--in", str(scenes_only), "constant shade=0.25", "plain"]
    assert run(app, [*within, "--room", "room-000000"]) == 0
    assert re.search(r"^frames of +room-000000$", capsys.readouterr().out, re.M)
    assert "no room 'kitchen'" in refused(capsys, *within[1:], "--room", "kitchen")
    assert run(app, ["bench", "compare", str(scenes_only), str(scenes_only)]) == 0
    said = capsys.readouterr().out
    assert re.search(r"constant shade=0.25 +\+0 +\+0 +\+0  unsure", said)
    assert re.search(r"wrong nan +not compared: ", said)
    assert max(map(len, said.splitlines()[2:])) <= 80

    assert run(app, ["bench", "board", str(scenes_only)]) == 0
    said = capsys.readouterr().out.splitlines()
    names = [line.split("  ")[0] for line in said[2:]]
    assert names[: len(board) - 1] == board[:-1]
    assert names[len(board) - 1] == "wrong nan"
    assert max(map(len, said)) <= 80
    columns = ["bench", "board", str(scenes_only), "--metrics", "psnr,rmse"]
    assert run(app, columns) == 0
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines())) <= 80
    order = re.findall(r"^(constant|plain|wrong) .* (\S+) +(\S+) +(\S+)$", said, re.M)
    assert order[-1] == ("wrong", "-", "-", "-")
    assert len(order) == len(board)
    psnr, rmse = ([float(row[column]) for row in order[:-1]] for column in (1, 2))
    assert psnr == sorted(psnr, reverse=True)
    assert all(0 < value < 1 for value in rmse)
    assert run(app, [*columns, "--room", "room-000000", "--markdown"]) == 0
    table = [line for line in capsys.readouterr().out.splitlines() if line.startswith("|")]
    assert table[:2] == ["| method | psnr | rmse | ms |", "| --- | ---: | ---: | ---: |"]
    assert len(table) == 2 + len(order)
    assert "no metric is named 'rmsee'" in refused(capsys, "board", scenes_only, "--metrics", "psnr,rmsee")
    assert f"score {scenes_only} --metrics flip` computes it" in refused(
        capsys, "board", scenes_only, "--metrics", "flip"
    )
    assert (
        run(app, ["bench", "board", str(scenes_only), "--metrics", "rmse", "--parts", "full,specular"]) == 0
    )
    said = capsys.readouterr().out
    assert re.search(r"^full / specular$", said, re.M)
    assert re.search(r"^plain shade=0\.5 +0\.\d+ / - +[\d.]+$", said, re.M)
    assert "--parts: 'gloss' is not allowed" in refused(capsys, "board", scenes_only, "--parts", "gloss")
    assert "no room 'kitchen'" in refused(capsys, "board", scenes_only, "--room", "kitchen")

    assert "'constant' has several settings" in refused(
        capsys, "compare", "--in", scenes_only, "constant", "plain", code=1
    )
    assert "no method 'plane'; did you mean 'plain'" in refused(
        capsys, "compare", "--in", scenes_only, "plane", "constant"
    )
    assert "no metric is named 'rmsee'" in refused(capsys, "compare", "a", "b", "--metric", "rmsee")
    assert "--part: 'gloss' is not allowed" in refused(capsys, "compare", "a", "b", "--part", "gloss")
    assert "holds a run with another preset" in refused(
        capsys, "run", "--preset", "smoke", "--methods", "plain", "--out", scenes_only
    )


def test_times_of_different_machines_are_not_compared(capsys, copy, results):
    for id in copy.ids():
        path = copy.result_file(id)
        record = json.loads(path.read_text())
        record["machine"]["cpu"] = "another"
        path.write_text(json.dumps(record))
    assert run(app, ["bench", "compare", str(results.root), str(copy.root)]) == 0
    said = capsys.readouterr().out
    assert said.count("times not compared: they are of different machines") == 6
    assert "prepared in" not in said


def test_a_preset_may_leave_the_variants_of_methods_to_those_who_name_them(tmp_path, monkeypatch):
    with_variant = dataclasses.replace(CONSTANT, variants=(Variant("other", {"shade": 0.25}),))
    point = EntryPoint("constant", f"{__name__}:WITH_VARIANT", registry.GROUP)
    monkeypatch.setattr(sys.modules[__name__], "WITH_VARIANT", with_variant, raising=False)
    monkeypatch.setattr(registry, "installed", lambda: registry.registry_of([point]))
    (tmp_path / "tiny.toml").write_text(toml(TINY))
    track = load_track(str(tmp_path / "tiny.toml"))
    preset = next(iter(track.presets.values()))
    for names, variants, expected in (
        (None, True, ["constant", "constant:other"]),
        (None, False, ["constant"]),
        ("constant:other", False, ["constant:other"]),
    ):
        found = _methods(names, track.id, preset.model_copy(update={"methods": {}, "variants": variants}))
        assert [one.method.id for one in found] == expected
