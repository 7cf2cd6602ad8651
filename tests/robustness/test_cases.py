"""What strangers' folders and files did to gibench once, each with what is right: the answers to `cases/robustness`."""

from __future__ import annotations

import os
import re
import runpy
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from gibench.cli import run as command
from gibench.cli.app import app, make_app

EXTERNAL = os.environ.get("GIBENCH_EXTERNAL")
CASES = Path(EXTERNAL or ".") / "cases"

pytestmark = pytest.mark.skipif(not EXTERNAL, reason="GIBENCH_EXTERNAL is unset")

MAKE, CONVERT = ["make-dataset"], ["convert", "scene.xml", "--out", "o"]


def make(recipe: str) -> list[str]:
    return [*MAKE, "--recipe", f"{recipe}.toml", "--out", "o"]


def cameras(name: str) -> list[str]:
    return [*MAKE, "--scene", "scene.xml", "--cameras", f"{name}.json", "--views", "0", "--out", "o"]


def scene(name: str) -> list[str]:
    return ["convert", f"{name}.xml", "--out", "o"]


#: Case, command, and what it answers: the end of one line on stderr, or a line on stdout where problems are listed.
ANSWERS = [
    ("camera-file-tracebacks", cameras("deep"), "camera file deep.json is no JSON"),
    ("camera-file-tracebacks", cameras("huge"), "huge.json, camera 0: origin is missing or not 3 numbers"),
    ("dataset-exr-dwab-bomb", ["dataset", "verify", "ds"], "its header states 67108864x1 pixels"),
    ("dataset-parquet-bomb", ["dataset", "verify", "ds"], r"frames\.parquet is damaged"),
    ("dataset-parquet-bomb", ["dataset", "preview", "ds"], r"frames\.parquet is damaged"),
    ("dataset-table-outside", ["dataset", "verify", "ds"], r"leads to '\.\./outside\.exr'"),
    (
        "dataset-table-outside",
        ["dataset", "preview", "ds", "--frame", "0", "--out", "x.png"],
        r"leads to '\.\./outside\.exr'",
    ),
    ("dataset-verify-dev-zero", ["dataset", "verify", "ds"], "2 problems"),
    ("dataset-verify-outside", ["dataset", "verify", "ds"], "secret' leads out of ds"),
    ("dataset-preview-no-channel", ["dataset", "preview", "ds"], r"0000\.exr holds no channel of a frame"),
    ("dataset-preview-no-channel", ["dataset", "preview", "ds", "--frame", "0"], "holds no channel"),
    ("out-name-too-long", [*MAKE, "--rooms", "1", "--out", "x" * 300], "cannot be written"),
    ("recipe-scenes-dropped", make("r"), r"scenes: \[1, 2\] is not allowed"),
    ("recipe-tracebacks", make("digits"), "digits.toml is no valid TOML"),
    ("recipe-tracebacks", make("null"), "is no name of a file"),
    ("recipe-tracebacks", make("long"), "environment: there is no file"),
    ("recipe-tracebacks", make("deep"), "too many brackets in one another"),
    ("recipe-tracebacks", ["bench", "run", "--track", "digits.toml"], "digits.toml is no valid TOML"),
    ("recipe-tracebacks", ["bench", "run", "--track", "deep.toml"], "too many brackets in one another"),
    ("run-scores-link-writes-outside", ["bench", "score", "run"], "scores is no folder of run itself"),
    ("score-tampered-frames", ["bench", "score", "run"], r"0000\.exr was changed after the run"),
    ("scene-bitmap-without-file", CONVERT, r"scene\.xml:3: the bitmap names no file"),
    ("scene-include-bomb", CONVERT, "more than 1000 files are included"),
    ("scene-instance-bomb", CONVERT, "more than 100000 are not read"),
    ("scene-parameter-bomb", CONVERT, r"scene\.xml:\d+"),
    ("scene-ply-index-outside", scene("m3"), r"m3\.ply: face 0 names vertex 3, and the file has 3"),
    ("scene-ply-index-outside", scene("m9"), r"m9\.ply: face 0 names vertex 1000000000"),
    ("scene-spectrum-file-outside", CONVERT, "'/etc/passwd' lies outside the folder of the scene"),
]


@pytest.fixture
def case(tmp_path, monkeypatch) -> Callable[[str], Path]:
    """A case's folder, as one may write in it, and the working folder. What was a link there is one again."""

    def take(name: str) -> Path:
        folder = tmp_path / "case"
        shutil.copytree(CASES / "robustness" / name, folder, symlinks=True)
        for path in (folder, *folder.rglob("*")):
            if not path.is_symlink():
                path.chmod(0o755 if path.is_dir() else 0o644)
        monkeypatch.chdir(folder)
        if (folder / "make.py").exists():
            runpy.run_path("make.py")
        return folder

    return take


def linked(path: Path, target: str) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
    path.symlink_to(target)


def answer(words: list[str], capfd) -> tuple[int, str, str]:
    code = command(make_app, words[1:]) if words[:1] == MAKE else command(app, words)
    out, err = capfd.readouterr()
    assert "Traceback" not in out + err
    return code, out, err


@pytest.mark.parametrize(("name", "words", "says"), ANSWERS)
def test_the_answer_is_a_line(case, capfd, name, words, says):
    case(name)
    code, out, err = answer(words, capfd)
    assert code in (1, 2)
    assert re.search(says, out + err)
    assert all(line.startswith(("error: ", "run/")) for line in err.strip().splitlines())


@pytest.mark.parametrize(
    "file", sorted(path.stem for path in (CASES / "robustness/scene-tracebacks").glob("*.xml"))
)
def test_scenes_that_are_wrong_are_refused_with_their_line(case, capfd, file):
    case("scene-tracebacks")
    code, _, err = answer(scene(file), capfd)
    assert code == 2
    assert re.fullmatch(rf"error: {file}\.xml:\d+: .*\n", err)


def test_a_pipe_is_no_regular_file(case, capfd):
    folder = case("dataset-fifo-hangs")
    glb = folder / "ds/rooms/000000/room.glb"
    glb.unlink()
    os.mkfifo(glb)
    code, out, _ = answer(["dataset", "verify", "ds"], capfd)
    assert code == 1
    assert re.search(r"room\.glb.* no regular file", out)


def test_control_characters_are_spelt_out(case, capfd):
    case("dataset-terminal-escapes")
    code, out, err = answer(["dataset", "info", "ds"], capfd)
    assert code == 0
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f]", out + err)
    assert r"\x1b]0;owned" in out


def test_a_licence_that_is_a_link_is_not_copied(case, capfd):
    folder = case("scene-licence-link-leaks")
    linked(folder / "scene/LICENSE", "../secret")
    code, _, _ = answer(["convert", "scene/scene.xml", "--out", "o"], capfd)
    assert code == 0
    secret = (folder / "secret").read_bytes()
    assert all(secret not in path.read_bytes() for path in (folder / "o").rglob("*") if path.is_file())


def test_a_spectrum_beside_the_scene_goes_with_it(case, capfd, monkeypatch, tmp_path):
    folder = case("scene-spectrum-file-beside")
    assert answer(CONVERT, capfd)[0] == 0
    (copy,) = (folder / "o/spectra").iterdir()
    assert copy.read_bytes() == (folder / "s.spd").read_bytes()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    import mitsuba as mi

    assert mi.load_file(str(folder / "o/scene.xml")) is not None


@pytest.mark.parametrize(
    ("name", "link", "target", "outside"),
    [
        ("run-lock-link-makes-file-outside", "run/.lock", "../made", "made"),
        ("run-results-link-deletes-outside", "run/results", "../home", "home"),
        ("run-scores-link-writes-outside", "run/scores", "../target", "target"),
    ],
)
def test_nothing_is_written_or_deleted_through_a_link(case, capfd, name, link, target, outside):
    folder = case(name)
    linked(folder / link, target)
    donor = CASES / "robustness/score-tampered-frames/run/run.json"
    (folder / "run/run.json").write_bytes(donor.read_bytes())  # whole, so that the links are what is met

    def there() -> dict[str, bytes]:
        found = [path for path in (folder / outside, *(folder / outside).rglob("*")) if path.is_file()]
        return {str(path): path.read_bytes() for path in found}

    before = there()
    assert answer(["bench", "score", "run"], capfd)[0] == 2
    assert there() == before


@pytest.mark.parametrize(
    "file", sorted(path.name for path in (CASES / "robustness/dataset-tracebacks").glob("*.*-*"))
)
def test_damaged_files_of_a_dataset_are_named(case, capfd, tmp_path, file):
    """Files of the kind `FILE-COMMAND-WHAT`, each put into a copy of a dataset."""
    sick = case("dataset-tracebacks") / file
    name = file.split("-")[0]
    ds = tmp_path / "ds"
    shutil.copytree(CASES / "robustness/dataset-terminal-escapes/ds", ds)
    target = ds / name if (ds / name).exists() else ds / "rooms/000000" / name
    for path in (ds, target.parent, target):
        path.chmod(0o755 if path.is_dir() else 0o644)
    target.write_bytes(sick.read_bytes())
    for words in (
        ["verify", str(ds)],
        ["info", str(ds)],
        ["preview", str(ds), "--out", str(tmp_path / "p.png")],
    ):
        code, _, err = answer(["dataset", *words], capfd)
        assert code in (0, 1, 2)
        assert code == 0 or err.startswith("error: ")


@pytest.mark.parametrize(
    "file", sorted(path.name for path in (CASES / "robustness/run-tracebacks").glob("*.json-*"))
)
def test_damaged_files_of_a_run_are_named(case, capfd, tmp_path, file):
    """Files of the kind `FOLDER-NAME-WHAT`, each put in the place of a run's own."""
    sick = case("run-tracebacks") / file
    run = tmp_path / "run"
    shutil.copytree(CASES / "robustness/report-dollar/run", run)
    for path in (run, *run.rglob("*")):
        path.chmod(0o755 if path.is_dir() else 0o644)
    head = file[: file.index(".json-") + len(".json")]
    target = run / head.replace("-", "/", 1) if "-" in head else run / head
    if not target.exists():  # of a result that this run calls otherwise
        target = sorted(target.parent.glob("*.json"))[0]
    target.write_bytes(sick.read_bytes())
    for words in (
        ["list", str(run)],
        ["score", str(run)],
        ["report", str(run), "--out", str(tmp_path / "board")],
    ):
        code, _, err = answer(["bench", *words], capfd)
        assert code in (0, 1, 2)
        if code:
            assert "error: " in err
            break


@pytest.mark.parametrize("name", ["report-dollar", "report-long-label", "run-track-name-writes-outside"])
def test_labels_and_names_of_results_are_text(case, capfd, name):
    folder = case(name)
    before = {path.name for path in folder.iterdir()}
    code, _, err = answer(["bench", "report", "run", "--out", "board"], capfd)
    assert code == 0 or (name.startswith("run-track") and re.search(r"error: .*\.json", err))
    assert {path.name for path in folder.iterdir()} - {"board"} == before


def test_metrics_refuse_what_they_cannot_read(case):
    """What `metrics-hostile/check.py` tries; tests of `metrics/inputs` have each alone."""
    import numpy as np

    from gibench import metrics

    case("metrics-hostile")
    image = np.ones((4, 4, 3), np.float32)
    assert metrics.mse(image.astype(">f4"), image) == 0
    assert metrics.mse(np.full((4, 4, 3), 1e200), image) == np.inf
    assert np.isfinite(metrics.tone_map(np.zeros((4, 4, 3)), 1e308)).all()
    with pytest.raises(metrics.MetricInputError):
        metrics.mse([[1.0], [1.0, 2.0]], image)


def test_a_mask_counts():
    """`masked-array/check.py` accepts an error that says so as well."""
    from gibench import metrics

    with pytest.raises(metrics.MetricInputError, match="mask="):
        runpy.run_path(str(CASES / "masked-array/check.py"))


#: Folders whose right value takes a full disk, a signal or minutes, and the test that stands for each.
ELSEWHERE = {
    "bench-disk-full-fails-results": ("benchmarks/test_running.py", "disk"),
    "bench-kill-leaves-bakes": ("baselines/test_bakes.py", "kill"),
    "sigterm-leaves-no-table": ("cli/test_stopping.py", "SIGTERM"),
    "worker-stopped-no-word": ("datasets/test_making.py", "SIGSTOP"),
    "hdrflip-dust": ("metrics/test_strange_inputs.py", "dust"),
    "no-home": ("metrics/test_lpips_weights.py", "HOME"),
    "denoised_highlight": ("rendering/test_denoise.py", "highlight"),
    "scale_texture": ("generators/imported/test_upgrading.py", "scaled_textures"),
}


def test_every_case_has_a_test():
    tests = Path(__file__).parents[1]
    sources = {path: path.read_text("utf-8") for path in tests.rglob("test_*.py")}
    for folder in ("", "robustness", "scenes"):
        for path in (CASES / folder).iterdir():
            if not path.is_dir() or path.name in ("robustness", "scenes"):
                continue
            if path.name in ELSEWHERE:
                place, word = ELSEWHERE[path.name]
                found = [text for file, text in sources.items() if (tests / place) in (file, *file.parents)]
                assert any(word in text for text in found), path.name
            else:
                assert any(path.name in text for text in sources.values()), path.name
