from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from gibench.benchmarks.orders import Order, ordered_methods
from gibench.benchmarks.result_files import RunFolder
from gibench.benchmarks.results import load
from gibench.benchmarks.running import Report, run
from gibench.benchmarks.scoring import score
from gibench.benchmarks.track import check_track
from tests.benchmarks import toys

TINY = {
    "id": "walkthrough",
    "title": "Tiny",
    "question": "does the harness work?",
    "varies": ["camera"],
    "prepared": "per room",
    "source": ["none"],
    "parts": ["full", "specular"],
    "metrics": ["rmse", "rmse_display", "dssim"],
    "sequence_metrics": ["temporal_difference"],
    "presets": {
        "tiny": {
            "rooms": 1,
            "seed": 4,
            "warmup": 1,
            "budget": {"prepare": 60, "render": 12},
            "room": {
                "resolution": [20, 14],
                "views": 2,
                "path": "walk",
                "path_views": 3,
                "kinds": ["living"],
            },
            "training": {"spp": 2, "channels": ["color", "albedo", "normal"]},
            "reference": {
                "spp": 64,
                "denoise": False,
                "channels": ["radiance", "position", "shape_id", "motion"],
            },
            "methods": {"constant": {"vary": {"shade": [0.25, 1.0]}}},
        }
    },
}


def order(*methods, overrides=None, **changes) -> Order:
    track = check_track(TINY)
    chosen = ordered_methods(track, "tiny", methods, overrides or {})
    return Order(track=track, preset="tiny", methods=chosen, command="gibench bench run --out R", **changes)


@pytest.fixture(scope="session")
def made(tmp_path_factory) -> tuple[Path, Report]:
    """A scored run of the toys that behave; nobody may change it."""
    root = tmp_path_factory.mktemp("bench") / "made"
    overrides = {
        "constant": {"shade": (0.25, 1.0), "style": ("plain", "fancy")},
        "plain": {"shade": (0.5, 2.0)},
    }
    report = run(
        root,
        order(toys.CONSTANT, toys.PLAIN, overrides=overrides),
        score=lambda doing: score(doing.folder),
    )
    return root, report


@pytest.fixture(scope="session")
def results(made):
    return load(made[0])


@pytest.fixture
def copy(made, tmp_path) -> RunFolder:
    """The same run, to be damaged."""
    shutil.copytree(made[0], tmp_path / "copy")
    return RunFolder(tmp_path / "copy")


@pytest.fixture
def scenes_only(made, tmp_path) -> Path:
    """A folder in which the scenes are made and nothing was run."""
    root = tmp_path / "run"
    for name in ("scenes", "run.json"):
        source = made[0] / name
        shutil.copytree(source, root / name) if source.is_dir() else shutil.copy(source, root / name)
    return root
