"""A run from anywhere: its files are checked before a board is made of them, and nothing in them is code."""

from __future__ import annotations

import csv
import json
import shutil

import numpy as np
import pytest

from gibench.benchmarks.errors import ResultsError
from gibench.benchmarks.predictions import encode
from gibench.benchmarks.result_files import RunFolder, key_of
from gibench.benchmarks.results import load
from gibench.benchmarks.scenes import refuse_files_outside, scenes_in
from gibench.benchmarks.scoring import score
from gibench.cli import run as command
from gibench.cli.app import app
from gibench.datasets.files import as_json
from tests.robustness import samples


def rewritten(run: RunFolder, number: int = 0, **changes) -> str:
    """Change a result as an attacker would, so that it fits its key again; returns its new id."""
    old = run.ids()[number]
    record = {**json.loads(run.result_file(old).read_text()), **changes}
    record["key"] = key_of(record["config"])
    record["id"] = record["key"][:16]
    run.result_file(old).unlink()
    run.result_file(record["id"]).write_bytes(as_json(record))
    return record["id"]


def good(run: RunFolder) -> str:
    return next(id for id in run.ids() if run.read_result(id)["status"] == "ok")


def commands(run: RunFolder, tmp_path):
    root = str(run.root)
    yield ["bench", "list", root]
    yield ["bench", "score", root]
    yield ["bench", "report", root, "--out", str(tmp_path / "board")]
    yield ["bench", "board", root]
    yield ["bench", "compare", "constant", "plain", "--in", root]


def test_the_sample_goes_through_every_command(run, tmp_path, capfd):
    for words in commands(run, tmp_path):
        assert command(app, words) == 0, capfd.readouterr().err


NEEDED = ("config", "title", "family", "label", "room", "kind", "created", "machine", "status")


@pytest.mark.parametrize(
    ("file", "change"),
    [
        *(("result", {key: None}) for key in NEEDED),
        ("result", {"room": "0"}),
        ("result", {"machine": {}}),
        ("result", {"frames": [{"seconds": None, "stages": {}}] * 3}),
        ("result", {"frames": [{"seconds": -1.0, "stages": {}}] * 3}),
        ("result", {"frames": []}),
        ("result", {"files": {"../../x.exr": {"sha256": "0" * 64, "bytes": 1}}}),
        ("result", {"prepare": {"seconds": "long"}}),
        ("result", {"label": "x" * 10**5}),
        ("run", {"metrics": [{}]}),
        ("run", {"metrics": ["no_such"]}),
        ("run", {"parts": []}),
        ("run", {"parts": ["../x"]}),
        ("run", {"machine": {}}),
        ("run", {"equal_time": [{}]}),
        ("run", {"track": "../x"}),
        ("scores", {"frames": {"full": 5}}),
        ("scores", {"frames": {"full": {"rmse": 5}}}),
        ("scores", {"frames": {"full": {"rmse": [0.1] * 9}}}),
        ("scores", {"sequences": []}),
        ("scores", {"skipped": None}),
        ("scores", {"exposures": [-1.0]}),
    ],
)
def test_what_says_something_else_is_named_and_nothing_more(run, tmp_path, capfd, file, change):
    score(run)
    path = {"result": run.result_file(good(run)), "run": run.run_file, "scores": run.score_file(good(run))}[
        file
    ]
    path.write_bytes(as_json({**json.loads(path.read_text()), **change}))
    refused = 0
    for words in commands(run, tmp_path):
        code = command(app, words)
        said = capfd.readouterr().err
        assert "Traceback" not in said
        if code:
            refused += 1
            assert code in (1, 2)
            assert path.name in said
    assert refused >= (
        1 if file == "scores" else 3
    )  # listing needs no scores, scoring goes on with what is whole


def test_numbers_of_a_floor_that_has_other_frames_are_kept_apart(run):
    """The scores of a scene are not those of a result, so their number is not bound to it."""
    score(run)
    path = run.score_file("room-000000")
    scores = json.loads(path.read_text())
    scores["frames"]["full"]["rmse"] = [0.1] * 9
    path.write_bytes(as_json(scores))
    assert len(load(run.root).floor) > 0


def test_frames_that_were_changed_after_the_run_are_not_scored(run, tmp_path, capfd):
    score(run)
    id = good(run)
    (run.predictions(id) / "0001.exr").write_bytes(encode({"full": np.ones((18, 24, 3), np.float32)}))
    assert command(app, ["bench", "score", str(run.root)]) == 1
    assert (
        f"{id}.json: its frame 0001.exr was changed after the run (SHA-256 differs)" in capfd.readouterr().err
    )
    assert command(app, ["bench", "report", str(run.root), "--out", str(tmp_path / "board")]) == 2
    assert "its frame 0001.exr was changed after the run (SHA-256 differs)" in capfd.readouterr().err
    (run.predictions(id) / "0001.exr").unlink()
    (run.predictions(id) / "0001.exr").symlink_to("/dev/zero")
    assert command(app, ["bench", "score", str(run.root)]) == 1
    assert "leads out of" in capfd.readouterr().err


@pytest.mark.parametrize(
    "labels", [("a $x$ b$", "x" * 150), ("$\\frac{", "_ % & # { } ~ ^ \\ " + "wort " * 40)]
)
def test_any_label_is_text(run, tmp_path, labels):
    for number, label in enumerate(labels):
        rewritten(run, number, label=label, title=label, family=label)
    score(run)
    assert command(app, ["bench", "report", str(run.root), "--out", str(tmp_path / "board")]) == 0
    assert all(label.strip() in (tmp_path / "board/leaderboard.csv").read_text() for label in labels)


def test_labels_are_no_formulas_html_or_escapes_to_whoever_reads(run, tmp_path, capfd):
    label = "=1+1 <script>alert(1)</script> | `x` \x1b[2J"
    rewritten(run, 0, label=label, title="<b>bold</b>")
    score(run)
    board = tmp_path / "board"
    assert command(app, ["bench", "report", str(run.root), "--out", str(board)]) == 0
    with open(board / "results.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert all(not row["label"].startswith("=") for row in rows)
    assert any(row["label"] == "'" + label for row in rows)
    for path in (board / "tables").iterdir():
        text = path.read_text()
        assert "\x1b" not in text
        if path.suffix == ".md":
            assert "<script" not in text
            assert "<b>" not in text
    assert "<script>alert" not in (board / "index.html").read_text()
    capfd.readouterr()
    assert command(app, ["bench", "list", str(run.root)]) == 0
    assert "\x1b" not in capfd.readouterr().out


def test_a_result_of_another_run_with_a_strange_shape_is_a_problem_not_a_crash(run):
    id = good(run)
    content = encode({"full": np.ones((5, 7, 3), np.float32)})
    record = run.read_result(id)
    (run.predictions(id) / "0000.exr").write_bytes(content)
    import hashlib

    record["files"]["0000.exr"] = {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}
    run.result_file(id).write_bytes(as_json(record))
    assert len(score(run).problems) == 1


def test_scores_with_more_frames_than_the_path_are_damaged(run):
    score(run)
    path = run.score_file(good(run))
    scores = json.loads(path.read_text())
    scores["frames"]["full"]["rmse"] = [0.1] * 9
    path.write_bytes(as_json(scores))
    with pytest.raises(ResultsError, match=f"{path.name} is damaged .*9 values of rmse for 3 frames"):
        _ = load(run.root).frames


SCENES = {
    '<shape type="ply"><string name="filename" value="meshes/a.ply"/></shape>': "",
    '<shape type="ply"><string name="filename" value="../../../../../../secret"/></shape>': "leads out of|No such",
    '<texture type="bitmap"><string name="filename" value="/etc/hostname"/></texture>': "is no file of",
    '<spectrum name="eta" filename="../secret"/>': "cannot be read|leads out of",
    '<include filename="meshes/a.ply"/>': "it holds <include>",
    '<path value="/"/>': "it holds <path>",
    "<unclosed>": "mismatched tag",
}


@pytest.mark.parametrize("inner", SCENES)
def test_scenes_of_a_run_name_files_of_their_own_folder_alone(run, inner):
    root = run.dataset("reference")
    (scene,) = scenes_in(*run.references)
    (scene.folder / "meshes").mkdir()
    (scene.folder / "meshes/a.ply").write_text("ply")
    (run.root.parent / "secret").write_text("secret")
    (scene.folder / "scene.xml").write_text(f'<scene version="3.0.0">{inner}</scene>')
    if not SCENES[inner]:
        refuse_files_outside(root, scene)
        return
    with pytest.raises(ResultsError, match=rf"scene\.xml is not read: .*({SCENES[inner]})"):
        refuse_files_outside(root, scene)


def test_scores_of_before_scenes_had_several_sequences_are_read(run):
    score(run)
    names = [good(run), "room-000000"]
    before, exposure = load(run.root), load(run.root).exposure("room-000000", 0)
    for name in names:
        scores = json.loads(run.score_file(name).read_text())
        scores["exposure"] = scores.pop("exposures")[0]
        for part, sequences in scores["sequences"].items():
            (scores["sequences"][part],) = sequences.values()
        run.score_file(name).write_bytes(as_json(scores))
    after = load(run.root)
    assert after.floor.equals(before.floor)
    assert after.sequences.drop(columns="sequence").equals(before.sequences.drop(columns="sequence"))
    assert after.exposure("room-000000", 0) == exposure


@pytest.mark.parametrize("exposures", [[], [1.0], [1.0] * 99])
def test_exposures_of_other_frames_are_computed_anew(run, exposures):
    score(run)
    right = [load(run.root).exposure("room-000000", frame) for frame in range(3)]
    path = run.score_file("room-000000")
    path.write_bytes(as_json({**json.loads(path.read_text()), "exposures": exposures}))
    assert [load(run.root).exposure("room-000000", frame) for frame in range(3)] == right


def rmse_and_floor(run):
    """Means over all frames."""
    found = load(run.root)
    return [float(table[table["metric"] == "rmse"]["value"].mean()) for table in (found.frames, found.floor)]


@pytest.mark.parametrize("of_before", [False, True])
def test_references_that_were_made_anew_are_scored_against_anew(run, monkeypatch, of_before):
    """Of the same scene and under the same name: neither the old errors stand, nor the old floor or exposure.

    of_before: scores that do not say what they are against.
    """
    score(run)
    assert score(run).done == 0
    exposure, before = load(run.root).exposure("room-000000", 0), rmse_and_floor(run)
    if of_before:
        for name in (good(run), "room-000000"):
            scores = json.loads(run.score_file(name).read_text())
            del scores["references"]
            run.score_file(name).write_bytes(as_json(scores))
        assert load(run.root).exposure("room-000000", 0) == exposure
    shades = samples.pixels

    path = {"path": "walk", "path_views": samples.FRAMES, "rendered": "path"}
    for seed, folder in enumerate(run.references):

        def brighter(channels, resolution, view, offset=50 * (seed + 1)):
            return {name: 2 * value for name, value in shades(channels, resolution, view + offset).items()}

        monkeypatch.setattr(samples, "pixels", brighter)
        shutil.rmtree(folder)
        samples.dataset(folder, 1, 1, **path, sample_seed=seed)
    if not of_before:
        assert load(run.root).exposure("room-000000", 0) == pytest.approx(exposure / 2, rel=0.2)
    assert score(run).done == 3
    assert load(run.root).exposure("room-000000", 0) == pytest.approx(exposure / 2, rel=0.2)
    after = rmse_and_floor(run)
    assert after[0] > 1.5 * before[0]
    assert after[1] > before[1] == 0
    assert score(run).done == 0
