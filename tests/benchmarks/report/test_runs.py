"""Runs brought together: which frames of a scene follow each other."""

from types import SimpleNamespace

import pandas as pd
import pytest

from gibench.benchmarks.report import ReportError
from gibench.benchmarks.report.runs import Runs


def run(track, **tags):
    """What `Runs` reads of a run to know its frames. tags: of the frames of each scene; a number for none."""
    records = [
        {
            "id": scene,
            "label": "isg",
            "config": {
                "scene": scene,
                "track": track,
                "scene_sha256": f"{track} {scene}",
                "seed": 0,
                "machine": "m",
            },
        }
        | ({"frames": [{}] * own} if isinstance(own, int) else {"tags": own})
        for scene, own in tags.items()
    ]
    return SimpleNamespace(root=track, records=lambda: records)


def paths(*runs):
    table = Runs(runs).paths
    return list(zip(table["scene"], table["frame"], table["sequence"], strict=True))


def test_stills_are_in_no_sequence():
    found = paths(run("relight", a=[["stills", "indoor"], ["stills", "outdoor"], ["turn", "indoor"]]))
    assert found == [("a", 0, ""), ("a", 1, ""), ("a", 2, "turn")]


def test_scenes_of_two_tracks_are_told_apart():
    found = paths(run("relight", a=[["stills"]]), run("walkthrough", a=[["path"]]))
    assert found == [("relight-a", 0, ""), ("walkthrough-a", 0, "path")]


def test_frames_without_tags_are_one_path():
    assert paths(run("walkthrough", a=2)) == [("a", 0, "path"), ("a", 1, "path")]


def test_what_failed_everywhere_has_no_frames():
    assert paths(run("walkthrough", a=0)) == []


def test_a_room_of_stills_alone_is_among_the_stills_of_its_track():
    one = run("unseen-rooms", a=[["stills"], ["walk"]], b=[["stills"], ["stills"]])
    rows = [(scene, frame, "rmse", "full", 1.0) for scene in "ab" for frame in (0, 1)]
    one.frames = pd.DataFrame(rows, columns=["result", "frame", "metric", "part", "value"])
    found = Runs([one]).frames
    assert found["part"].value_counts().to_dict() == {"full": 4, "full:stills": 3, "full:walk": 1}
    # Where all are stills, a group of them would say the same twice.
    alike = run("unseen-rooms", a=[["stills"]], b=[["stills"]])
    alike.frames = one.frames[one.frames["frame"] == 0]
    assert set(Runs([alike]).frames["part"]) == {"full"}


def test_two_results_of_one_setting_are_refused():
    one, other = (run("relight", a=[["stills"]]) for _ in "ab")
    assert paths(one, other) == [("relight-a", 0, "")]  # a result that both have
    (record,) = other.records()
    record["id"] = "another"
    with pytest.raises(
        ReportError, match="both have 'isg' in a, of other code, knobs or training: report them apart"
    ):
        Runs([one, other])
