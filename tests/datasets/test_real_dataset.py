"""From a command to a dataset with the real generators and the real renderer; small, since each process compiles."""

import hashlib
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from gibench.cli import run
from gibench.cli.app import make_app
from gibench.datasets import folder, open_dataset
from gibench.datasets.verifying import verify

TINY = ["--resolution", "16x12", "--spp", "2", "--views", "1", "--rooms", "2", "--channels", "radiance,depth"]


def frames_of(root: Path) -> list[str]:
    return [
        hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(root.glob("rooms/0*/frames/*.exr"))
    ]


def command(*words: str | Path) -> subprocess.Popen[str]:
    """The command in a process group of its own, as a shell starts it."""
    code = "from gibench.cli import make_dataset\nif __name__ == '__main__':\n    make_dataset()"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, words)],
        start_new_session=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
    )  # fmt: skip


def wait_until(condition, process: subprocess.Popen[str]) -> None:
    end = time.monotonic() + 300
    while not condition():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.01)


@pytest.fixture(scope="module")
def smoke(tmp_path_factory) -> Path:
    root = tmp_path_factory.mktemp("real") / "smoke"
    assert run(make_app, ["--preset", "smoke", "--out", str(root)]) == 0
    return root


def test_the_smoke_preset_makes_a_whole_dataset(smoke, capsys):
    assert verify(smoke) == []
    dataset = open_dataset(smoke)
    assert len(dataset) == 4
    assert {"mitsuba", "drjit", "llvm", "mitsuba-oidn", "numpy", "gibench"} <= set(
        dataset.manifest["versions"]
    )
    assert dataset.manifest["totals"]["invalid_paths"] == 0
    assert dataset.manifest["totals"]["kernel_seconds"] > 0
    assert (dataset.frames["median_error"] > 0).all()


def test_frames_show_a_furnished_room(smoke):
    dataset = open_dataset(smoke)
    for frame in dataset:
        arrays = frame.read()
        assert arrays["color"].shape == (48, 64, 3)
        assert (arrays["color"] > 0).mean() > 0.9
        materials, shapes = dataset.names(frame.room)
        assert 1 <= arrays["material_id"].max() <= len(materials)
        assert 1 <= arrays["shape_id"].max() <= len(shapes)
        assert np.unique(arrays["shape_id"]).size >= 5
        # The camera that the table names took the picture: its rays end where the positions are.
        camera = np.array([frame.row[f"camera_{axis}"] for axis in "xyz"])
        hit = arrays["distance"][..., 0] > 0
        distance = np.linalg.norm(arrays["position"] - camera, axis=-1)
        np.testing.assert_allclose(distance[hit], arrays["distance"][..., 0][hit], rtol=1e-4)


def test_any_reader_of_openexr_finds_the_picture(smoke):
    frame = open_dataset(smoke)[0]
    with OpenEXR.File(str(frame.path)) as file:  # grouped as viewers do
        picture = file.channels()["RGB"].pixels
    np.testing.assert_array_equal(picture.astype(np.float32), frame["color"])


def test_stops_and_kills_leave_the_pixels_as_they_are(tmp_path):
    whole, stopped = tmp_path / "whole", tmp_path / "stopped"
    assert run(make_app, [*TINY, "--out", str(whole), "--workers", "2"]) == 0

    process = command(*TINY, "--out", stopped)
    wait_until(lambda: folder.whole_rooms(stopped), process)
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert re.fullmatch(
        r"error: stopped with 1 of 2 rooms whole; to continue run `make-dataset --rooms 2 --out .*`\n", said
    )
    assert {problem.file for problem in verify(stopped)} == {"dataset.json", "rooms/000001"}

    process = command(*TINY, "--out", stopped)
    wait_until(lambda: list((stopped / "rooms").glob(".*.partial-*")), process)
    process.kill()
    process.communicate(timeout=60)

    assert run(make_app, [*TINY, "--out", str(stopped)]) == 0
    assert frames_of(stopped) == frames_of(whole)
    assert verify(stopped) == []


def test_a_dry_run_keeps_nothing_and_says_what_it_would_take(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(make_app, [*TINY, "--dry-run"]) == 0
    said = capsys.readouterr().out
    assert "rooms         2 built and checked" in said
    assert re.search(r"time +about \d", said)
    assert re.search(r"disk +about [\d.]+ MB", said)
    assert list(tmp_path.iterdir()) == []


def test_an_environment_that_is_not_finite_is_refused_before_anything_is_made(tmp_path, capfd):
    sky = np.full((8, 16), np.nan, np.float32)
    OpenEXR.File({}, {"R": sky, "G": sky, "B": sky}).write(str(tmp_path / "sky.exr"))
    (tmp_path / "mine.toml").write_text('rooms = 1\nenvironment = "sky.exr"\n')
    assert run(make_app, ["--recipe", str(tmp_path / "mine.toml"), "--out", str(tmp_path / "d")]) == 2
    said = capfd.readouterr().err
    assert re.search(r"error: environment: hdr .*sky\.exr: \d+ values are negative or not finite", said)
    assert not (tmp_path / "d").exists()
