import json

import numpy as np
import pytest

from gibench.benchmarks.errors import ResultsError
from gibench.benchmarks.result_files import RunFolder, canonical, key_of
from gibench.benchmarks.results import COLUMNS, load

FORMATS = [("gibench", "9.9.9"), ("format", 99)]


def test_tables_are_tidy(results):
    table = results.results
    assert list(table.columns) == list(COLUMNS)
    assert len(table) == 6
    assert set(table["status"]) == {"ok"}
    assert set(table["scene"]) == {"room-000000"}
    assert table["result"].is_unique
    assert (table["ms_p95"] >= table["ms_median"]).all()
    assert (table["frames"] == 3).all()
    assert json.loads(table.set_index("label").loc["plain shade=2", "knobs"]) == {"shade": 2.0}

    frames = results.frames
    assert list(frames.columns) == ["result", "frame", "ms", "metric", "part", "value"]
    # Three metrics of three frames: of both parts for four results, of the full image for two.
    assert len(frames) == 3 * 3 * (2 * 4 + 2)
    assert not frames.duplicated(["result", "frame", "metric", "part"]).any()
    assert frames["value"].notna().all()

    assert set(results.sequences["metric"]) == {
        f"temporal_difference{end}" for end in ("", "_prediction", "_reference")
    }
    assert list(results.floor.columns) == ["scene", "frame", "metric", "part", "value"]
    assert set(results.floor["frame"]) == {-1, 0, 1, 2}
    assert results.skipped == {}


def test_extras_are_what_methods_say_of_their_frames(results):
    extras = results.extras
    assert list(extras.columns) == ["result", "frame", "name", "value"]
    assert set(extras["name"]) == {"process", "odds"}
    assert extras.loc[extras["name"] == "odds", "value"].isna().all()
    processes = extras[extras["name"] == "process"]
    assert set(processes["result"]) == set(results.results["result"])
    for id, own in processes.groupby("result"):
        said = [frame["extra"]["process"] for frame in results.record(id)["frames"]]
        assert own.sort_values("frame")["value"].tolist() == said


def test_times_are_those_of_the_frames(results):
    merged = results.times.merge(results.results, on="result")
    for _, group in merged.groupby("result"):
        assert group["ms"].median() == pytest.approx(group["ms_median"].iloc[0])
        assert np.percentile(group["ms"], 95) == pytest.approx(group["ms_p95"].iloc[0])
    stages = results.stages
    assert set(stages["stage"]) == {"gather", "other"}
    for id in results.results["result"]:
        own = stages[stages["result"] == id]
        frames = results.record(id)["frames"]
        assert "other" in set(own["stage"])
        if len(own) == 2:
            gather = [1000 * frame["stages"]["gather"] for frame in frames]
            assert own.set_index("stage").loc["gather", "ms_median"] == pytest.approx(np.median(gather))


def test_pixels_are_read_by_part(results):
    label = results.results.set_index("label")["result"]
    np.testing.assert_array_equal(results.prediction(label["constant shade=1"], 2, "specular"), 0.5)
    with pytest.raises(ResultsError, match="has no part 'specular'"):
        results.prediction(label["plain shade=2"], 2, "specular")
    full, specular = (results.reference("room-000000", 1, part) for part in ("full", "specular"))
    assert full.shape == specular.shape == (14, 20, 3)
    assert (specular <= full * 1.01 + 1e-3).all()
    with pytest.raises(ResultsError, match="has no scene 'room-9'; it has room-000000"):
        results.reference("room-9", 0)


def test_the_latest_code_stands(copy):
    record = copy.read_result(copy.ids()[0])
    config = {**record["config"], "code": {**record["config"]["code"], "sources": "edited"}}
    key = key_of(config)
    newer = {**record, "config": config, "key": key, "id": key[:16], "created": "2999-01-01T00:00:00+00:00"}
    copy.result_file(key[:16]).write_text(json.dumps(newer))
    again = load(copy.root)
    assert len(again.results) == 6
    assert again.superseded == 1
    assert key[:16] in set(again.results["result"])
    assert record["id"] not in set(again.results["result"])


def another(folder, record, **changes):
    """A result like one that is there, of another configuration. Its id."""
    config = {**record["config"], **changes}
    key = key_of(config)
    made = {**record, "config": config, "key": key, "id": key[:16], "created": "2999-01-01T00:00:00+00:00"}
    folder.result_file(key[:16]).write_text(json.dumps(made))
    return key[:16]


def test_what_was_asked_for_last_stands(copy):
    """Code that is changed and changed back finds its results again, though others were made since."""
    record = copy.read_result(copy.ids()[0])
    newer = another(copy, record, code={**record["config"]["code"], "sources": "edited"})
    assert newer in set(load(copy.root).results["result"])
    copy.write_run(copy.read_run() | {"asked": {record["id"]: "2999-01-01T00:00:01+00:00"}})
    again = load(copy.root)
    assert record["id"] in set(again.results["result"])
    assert again.superseded == 1


def test_one_label_is_one_row_whatever_it_leaves_out(copy):
    """A knob that came with a later version, or another base in the track's file, is not in the label."""
    record = copy.read_result(copy.ids()[0])
    newer = another(copy, record, knobs={**record["config"]["knobs"], "added": 1})
    again = load(copy.root)
    assert len(again.results) == 6
    assert set(again.results["result"]) & {newer, record["id"]} == {newer}
    assert again.mixed == []


def test_rows_of_several_versions_are_named(copy, results):
    assert results.mixed == []
    record = copy.read_result(copy.ids()[0])
    another(copy, record, scene="room-000001", code={**record["config"]["code"], "sources": "edited"})
    assert load(copy.root).mixed == [record["label"]]


@pytest.mark.parametrize("content", ["", "{", "[]", "{}", "null", '{"format": 1}'])
def test_a_cut_off_result_is_named_with_what_to_do(copy, content):
    path = copy.result_file(copy.ids()[0])
    path.write_text(content)
    with pytest.raises(ResultsError, match=f"{path.name}.*(damaged|format).*(remove|run again)"):
        load(copy.root)


def test_a_result_that_was_changed_is_damaged(copy):
    path = copy.result_file(copy.ids()[0])
    record = json.loads(path.read_text())
    record["config"]["knobs"]["shade"] = 7
    path.write_text(json.dumps(record))
    with pytest.raises(ResultsError, match="is damaged: it does not say what its name does"):
        load(copy.root)


@pytest.mark.parametrize("which", ["run.json", "result"])
def test_another_version_is_refused_with_what_to_do(copy, which):
    path = copy.run_file if which == "run.json" else copy.result_file(copy.ids()[0])
    path.write_text(json.dumps({**json.loads(path.read_text()), "format": 99, "gibench": "9.9.9"}))
    with pytest.raises(
        ResultsError, match=r"is of format 99, this gibench .* reads format 1: read it with .* \(9\.9\.9\)"
    ):
        load(copy.root)


def test_what_is_no_folder_of_results(tmp_path):
    with pytest.raises(
        ResultsError, match=r"holds no results: it has no run\.json; `gibench bench run` makes them"
    ):
        load(tmp_path)
    (tmp_path / "run.json").write_text("{")
    with pytest.raises(ResultsError, match=r"run\.json is damaged \(it is cut off or no JSON\)"):
        load(tmp_path)


def test_the_key_does_not_depend_on_how_a_configuration_is_written():
    a = {"method": "é", "knobs": {"b": 1, "a": 0.1}}
    b = {"knobs": {"a": 0.1, "b": 1}, "method": "é"}
    assert canonical(a) == canonical(b)
    assert key_of(a) == key_of(json.loads(json.dumps(a)))
    assert key_of({**a, "knobs": {"b": 2, "a": 0.1}}) != key_of(a)


def test_ids_leave_out_what_is_half_written(tmp_path):
    folder = RunFolder(tmp_path)
    folder.results.mkdir()
    for name in ("0123456789abcdef.json", ".0123456789abcdef.json.partial-7", "notes.json"):
        (folder.results / name).touch()
    assert folder.ids() == ["0123456789abcdef"]


def test_some_of_the_frames(copy, results):
    """Groups are tags of frames; a sequence is of a group if its frames are, and noise floors go with them."""
    (name,) = set(results.sequences["sequence"])
    tags = [["stills", "near", "indoor"], ["stills", "far", "outdoor"], [name, "outdoor"]]
    for id in copy.ids():
        path = copy.result_file(id)
        path.write_text(json.dumps(json.loads(path.read_text()) | {"tags": tags}))
    run = load(copy.root)
    for group, frames, sequences in [
        ("near", {0}, False),
        ("stills", {0, 1}, False),
        ("outdoor", {1, 2}, True),
        (name, {2}, True),
    ]:
        some = run.among(room="room-000000", group=group)
        assert set(some.frames["frame"]) == frames
        kept = run.frames[run.frames["frame"].isin(frames)]
        assert some.frames["value"].tolist() == kept["value"].tolist()
        assert some.sequences.empty != sequences
        assert set(some.floor["frame"]) == (frames | {-1} if sequences else frames)
    assert run.among(room="room-000000").frames.equals(run.frames)
    with pytest.raises(ResultsError, match=r"no room 'room-00000'; did you mean 'room-000000'"):
        run.among(room="room-00000")
    with pytest.raises(ResultsError, match=r"no group of frames 'door'; did you mean '(in|out)door'"):
        run.among(group="door")
    with pytest.raises(ResultsError, match="no group of frames 'near'"):
        results.among(group="near")


def test_stills_of_a_run_without_sequences(copy):
    for id in copy.ids():
        path = copy.result_file(id)
        path.write_text(json.dumps(json.loads(path.read_text()) | {"tags": [["stills"]] * 3}))
        scores = json.loads(copy.score_file(id).read_text())
        copy.score_file(id).write_text(json.dumps(scores | {"sequences": {}}))
    some = load(copy.root).among(group="stills")
    assert len(some.frames) > 0
    assert list(some.sequences.columns) == ["result", "sequence", "metric", "part", "value"]
    assert some.sequences.empty
