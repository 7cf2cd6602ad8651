"""Frames to train on are lit by panoramas of rooms too, and stills are told apart by how near they are to these."""

import copy
import json

from gibench.benchmarks.orders import Order, ordered_methods
from gibench.benchmarks.report.runs import Runs
from gibench.benchmarks.result_files import RunFolder
from gibench.benchmarks.results import load
from gibench.benchmarks.running import run
from gibench.benchmarks.scoring import score
from gibench.benchmarks.track import check_track
from gibench.datasets import open_dataset
from tests.benchmarks import toys
from tests.benchmarks.conftest import TINY


def track():
    values = copy.deepcopy(TINY)
    preset = values["presets"]["tiny"]
    preset["room"] = {
        "resolution": [16, 16],
        "kinds": ["still-life"],
        "lighting": "environments",
        "views": 5,
        "trajectories": 1,
        "held_out": 3,
        "far": 2,
    }
    preset["panoramas"] = {"count": 1, "spp": 1}
    preset["training"] |= {"environments": "esplanade", "rotations": 3}
    preset["reference"] |= {"environments": "test", "spp": 2}
    return check_track({**values, "metrics": ["rmse"], "sequence_metrics": []})


def test_a_run(tmp_path):
    root, told = tmp_path / "run", []
    chosen = ordered_methods(track(), "tiny", [toys.LEARNER], {})
    order = Order(track=track(), preset="tiny", methods=chosen)
    run(
        root,
        order,
        score=lambda doing: score(doing.folder),
        on_state=lambda state: told.append(state.panoramas),
    )
    folder = RunFolder(root)
    (panorama,) = folder.panoramas.glob("*.exr")
    assert (1, 1) in told

    training = open_dataset(folder.dataset("training"))
    assert set(training.manifest["identity"]["environments"]) == {"esplanade", panorama.stem}
    assert set(training.frames["environment"]) == {"esplanade", panorama.stem}
    degrees = (training.frames["environment_rotation"] * 180 / 3.14159265).round(3)
    assert set(degrees) <= {0, 120, 240}
    assert json.loads(folder.run_file.read_text())["identity"]["training"]["panoramas"]["count"] == 1

    (record,) = (folder.read_result(id) for id in folder.ids())
    assert [tags[:2] for tags in record["tags"]] == [["stills", "near"], ["stills", "far"], ["stills", "far"]]
    # Lighting the scene anew takes its time, beside the clock of the method.
    assert all(frame["lighting_seconds"] > 0 for frame in record["frames"])
    boards = Runs([load(root)]).frames
    groups = boards[boards["metric"] == "rmse"].groupby("part")["value"].count()
    assert (groups["full:near"], groups["full:far"], groups["full:stills"]) == (1, 2, 3)
