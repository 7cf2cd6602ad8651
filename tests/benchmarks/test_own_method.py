"""A method in a package of the user's own, as `docs/adding-a-method.md` says: installed, run, on the board."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gibench.benchmarks.results import load
from gibench.benchmarks.statistics import leaderboard
from tests.benchmarks.conftest import TINY
from tests.benchmarks.test_commands import toml

PAGE = Path(__file__).parents[2] / "docs/adding-a-method.md"

pytestmark = pytest.mark.skipif(not PAGE.exists(), reason="tests run away from the documentation")


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """Where pip has installed the package of the page, without a network."""
    if any(importlib.util.find_spec(name) is None for name in ("pip", "setuptools")):
        pytest.skip("pip and setuptools are not both installed")
    source, target = tmp_path_factory.mktemp("flatlight"), tmp_path_factory.mktemp("site")
    for name, text in files().items():
        (source / name).parent.mkdir(exist_ok=True)
        (source / name).write_text(text, "utf-8")
    command = [
        "install",
        "--no-index",
        "--no-deps",
        "--no-build-isolation",
        "--target",
        str(target),
        str(source),
    ]
    done = subprocess.run(
        [sys.executable, "-m", "pip", *command], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return target


def files() -> dict[str, str]:
    """Name → content of the blocks that begin with a name."""
    blocks = re.findall(r"^```(?:toml|python)\n# (\S+)\n(.*?)^```$", PAGE.read_text("utf-8"), re.M | re.S)
    assert [name for name, _ in blocks] == ["pyproject.toml", "flatlight/__init__.py", "flatlight/method.py"]
    return dict(blocks)


def command(site: Path, *words: str) -> subprocess.CompletedProcess[str]:
    code = "from gibench.cli import main\nif __name__ == '__main__':\n    main()"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(site), *(p for p in sys.path if p)])}
    return subprocess.run(
        [sys.executable, "-c", code, "bench", *words],
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )


def test_it_has_at_most_thirty_lines():
    lines = files()["flatlight/method.py"].splitlines()
    assert len([line for line in lines if line.strip()]) <= 30


def test_it_is_listed_without_anything_heavy(site):
    done = command(site, "list")
    assert re.search(r"method flat-light: Flat light \(ambient; flatlight 0\.1\)", done.stdout), done.stderr


def test_it_runs_and_stands_on_the_board(site, made, tmp_path):
    root, track = tmp_path / "run", tmp_path / "tiny.toml"
    track.write_text(toml(TINY), "utf-8")
    shutil.copytree(made[0] / "scenes", root / "scenes")
    shutil.copy(made[0] / "run.json", root)
    options = ["--track", str(track), "--preset", "tiny", "--out", str(root)]
    done = command(site, "run", *options, "--methods", "flat-light", "--set", "flat-light.rays=1,4")
    assert done.returncode == 0, done.stderr
    assert "flat-light rays=4" in done.stdout
    results = load(root)
    board = leaderboard(results, "rmse")
    assert set(board["label"]) == {"flat-light", "flat-light rays=4"}
    # It is as bright as the room is, more or less: far from an image that is black.
    black = float((results.reference("room-000000", 0) ** 2).mean() ** 0.5)
    assert 0 < board["mean"].min() < black
    record = results.records()[0]
    assert record["config"]["code"]["package"] == "flatlight 0.1"
    assert record["prepare"]["references"] > 0
    # Both settings use one training.
    trainings = {bake["folder"] for r in results.records() for bake in r["prepare"]["bakes"]}
    assert len(trainings) == 1
    assert trainings.pop().startswith("training-")


def test_two_packages_that_claim_it_are_both_named(site, tmp_path):
    other = tmp_path / "other"
    shutil.copytree(site / "flatlight", other / "darklight")
    information = other / "darklight-2.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: darklight\nVersion: 2.0\n")
    (information / "entry_points.txt").write_text("[gibench.methods]\nflat-light = darklight:METHOD\n")
    both = Path(os.pathsep.join([str(site), str(other)]))
    done = command(both, "run", "--methods", "flat-light", "--out", str(tmp_path / "r"))
    assert done.returncode == 2
    assert "'flat-light' is claimed by darklight 2.0 and flatlight 0.1: uninstall one" in done.stderr
    assert not (tmp_path / "r").exists()
