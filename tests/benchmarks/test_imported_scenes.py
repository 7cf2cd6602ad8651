"""A track on a scene file in the place of rooms."""

from __future__ import annotations

import pytest

from gibench.benchmarks.errors import ResultsError
from gibench.benchmarks.results import load
from gibench.benchmarks.running import run
from gibench.benchmarks.scoring import score
from tests.benchmarks import toys
from tests.benchmarks.conftest import order
from tests.generators.imported.files import SQUARE, room_file


def test_every_method_of_a_track_runs_on_a_scene(tmp_path):
    file = room_file(tmp_path / "cabin")
    scenes = {"scenes": (str(file),)}
    asked = order(toys.CONSTANT, toys.PLAIN, scenes=scenes)
    report = run(tmp_path / "run", asked, score=lambda doing: score(doing.folder))
    assert not report.failed
    results = load(tmp_path / "run")
    assert set(results.results["status"]) == {"ok"}
    assert set(results.results["method"]) == {"constant", "plain"}
    assert (tmp_path / "run/scenes/reference/rooms/000000/scene.xml").is_file()
    assert run(tmp_path / "run", asked).made == 0  # all is there
    other = room_file(tmp_path / "other", extra=SQUARE)
    with pytest.raises(ResultsError, match="holds a run with another reference"):
        run(tmp_path / "run", order(toys.CONSTANT, scenes={"scenes": (str(other),)}))
