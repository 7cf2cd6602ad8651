import math

import pytest

from gibench.benchmarks.equal_time import last_within, search
from gibench.benchmarks.orders import Order, ordered_methods
from gibench.benchmarks.result_files import RunFolder
from gibench.benchmarks.running import run
from tests.benchmarks import toys
from tests.benchmarks.conftest import order
from tests.benchmarks.test_training_on_rooms import track as on_rooms


@pytest.mark.parametrize("count", [1, 2, 3, 6, 17])
def test_bisection_finds_the_dearest_that_fits(count):
    values = tuple(range(count))
    for fits in range(-1, count):
        asked = []

        def measure(value, asked=asked, fits=fits):
            asked.append(value)
            return 0.0 if value <= fits else 1.0

        assert last_within(values, 0.5, measure) == fits
        assert len(asked) == len(set(asked)) <= math.ceil(math.log2(count + 1))
        assert fits < 0 or fits in asked
        assert fits == count - 1 or fits + 1 in asked


def test_what_meets_the_time_is_measured_and_recorded(scenes_only):
    paused = toys.found("Constant", id="paused", knobs=(toys.PAUSE,), budget="pause")
    plain = toys.found("Plain", id="knobless")
    report = run(scenes_only, order(paused, plain), work=lambda doing: search(doing, 20.0))
    folder = RunFolder(scenes_only)
    entries = {entry["method"]: entry for entry in folder.read_run()["equal_time"]}
    entry = entries["paused"]
    assert (entry["knob"], entry["value"], entry["label"]) == ("pause", 0.01, "paused pause=0.01")
    assert 10 <= entry["measured_ms"] <= 20
    assert entry["tried"]["0.03"] >= 30
    assert "0.1" not in entry["tried"]  # 0.03 was too much already
    assert entries["knobless"]["label"] == "knobless"
    assert entries["knobless"]["value"] is None
    labels = {folder.read_result(id)["label"] for id in report.ids}
    assert labels == {"paused pause=0.01", "knobless"}
    # Trials are results like all others, and found again.
    before = set(folder.ids())
    again = run(scenes_only, order(paused, plain), work=lambda doing: search(doing, 20.0))
    assert again.made == 0
    assert set(folder.ids()) == before
    assert len(folder.read_run()["equal_time"]) == 2


def test_a_time_that_nothing_meets_is_recorded_too(scenes_only):
    slow = toys.found(
        "Constant", id="slow", knobs=(toys.Knob("pause", 0.03, (0.03, 0.1), "s"),), budget="pause"
    )
    report = run(scenes_only, order(slow), work=lambda doing: search(doing, 5.0))
    (entry,) = RunFolder(scenes_only).read_run()["equal_time"]
    assert entry["value"] is entry["label"] is entry["measured_ms"] is None
    assert entry["tried"]["0.03"] >= 30
    assert report.ids == ()


def test_a_training_that_fails_fails_all_values(tmp_path):
    """The first value that is tried records it; the others are not trained again, and have no record."""
    failing = toys.found(
        "Learner",
        knobs=(toys.Knob("how", "failing", ("failing",), "trains", trains=True), toys.PAUSE),
        channels=("color",),
        trains=True,
        budget="pause",
    )
    chosen = ordered_methods(on_rooms(), "tiny", [failing], {})
    asked = Order(track=on_rooms(), preset="tiny", methods=chosen)
    report = run(tmp_path / "run", asked, work=lambda doing: search(doing, 20.0))
    (entry,) = RunFolder(tmp_path / "run").read_run()["equal_time"]
    assert entry["value"] is None
    assert len(entry["tried"]) > 1
    assert set(entry["tried"].values()) == {None}
    assert report.ids == ()
    assert len(report.failed) == 1
