"""What is trained on rooms is trained once, found again, charged to every scene, and told once where it fails."""

import copy

from gibench.benchmarks.orders import Order, ordered_methods
from gibench.benchmarks.result_files import RunFolder
from gibench.benchmarks.running import run
from gibench.benchmarks.track import check_track
from gibench.datasets import open_dataset
from gibench.datasets.cache import opened_cache
from tests.benchmarks import toys
from tests.benchmarks.conftest import TINY


def track():
    values = copy.deepcopy(TINY) | {"prepare_on": "rooms"}
    preset = values["presets"]["tiny"]
    preset |= {"rooms": 2, "training_rooms": 1, "training_seed": 9}
    preset["training"] |= {"views": 1}
    preset["reference"] |= {"spp": 2}
    preset["budget"] |= {"training": 7, "render": 60}
    return check_track(values)


def test_a_training_on_rooms(tmp_path):
    root, told = tmp_path / "run", []
    chosen = ordered_methods(track(), "tiny", [toys.LEARNER], {"learner": {"how": ("well", "failing")}})
    order = Order(track=track(), preset="tiny", methods=chosen)
    report = run(root, order, on_state=lambda state: told.append(state.training))
    folder = RunFolder(root)
    records = [folder.read_result(id) for id in folder.ids()]

    good = [r for r in records if r["status"] == "ok"]
    assert {r["config"]["scene"] for r in good} == {"room-000000", "room-000001"}
    assert len({r["prepare"]["bakes"][0]["folder"] for r in good}) == 1
    assert len(list(folder.bakes("rooms").glob("training-*/mean.txt"))) == 1
    seconds = [r["prepare"]["training"] for r in good]
    assert seconds[0] == seconds[1] > 0
    assert all(r["prepare"]["references"] > 0 for r in good)
    assert [training["method"] for training in told if training] == ["learner"]

    # What it reads over and over is decoded once, outside of its clock.
    cache = opened_cache(open_dataset(folder.dataset("training")))
    assert cache is not None
    assert cache.channels == {"color"}

    (failed,) = [r for r in records if r["status"] == "failed"]
    assert failed["reason"] == "in the training: ValueError: nothing to learn"
    assert len(report.failed) == 1
    mean, rooms, limit = next(folder.bakes("rooms").glob("training-*/mean.txt")).read_text().split(" ", 2)
    assert (rooms, limit) == ("(0,)", "7.0")
    assert float(mean) > 0
