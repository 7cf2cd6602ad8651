"""Runs brought together: which frames of a scene follow each other."""

from types import SimpleNamespace

from gibench.benchmarks.report.runs import Runs


def run(track, **tags):
    """What `Runs` reads of a run to know its frames. tags: of the frames of each scene; a number for none."""
    records = [
        {"id": scene, "config": {"scene": scene, "track": track, "scene_sha256": f"{track} {scene}"}}
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
