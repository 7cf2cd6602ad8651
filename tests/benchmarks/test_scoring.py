import json
import os
import shutil
import signal
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from gibench import metrics
from gibench.baselines import sources
from gibench.baselines.sources import module_of
from gibench.benchmarks import scoring
from gibench.benchmarks.errors import ResultsError, RunError
from gibench.benchmarks.references import half_parts, reference_parts
from gibench.benchmarks.scenes import scenes_in
from gibench.benchmarks.scoring import compute, score
from gibench.benchmarks.track import MOVING
from gibench.datasets import pool
from gibench.datasets.exr import encode
from gibench.rendering.channels import PARTS, SAMPLED

SEQUENCE = ["warping_error", "temporal_difference", "mabd"]


@pytest.fixture(scope="module")
def scene(made):
    (only,) = scenes_in(made[0] / "scenes/reference", made[0] / "scenes/reference-again")
    return only


def noisy(scene, amount: float = 0.2):
    """A prediction that differs from pixel to pixel and from frame to frame."""

    def frame_of(frame):
        rng = np.random.default_rng(frame)
        parts = reference_parts(scene, frame)
        return {
            part: (image * np.exp(amount * rng.standard_normal(image.shape))).astype(np.float32)
            for part, image in parts.items()
        }

    return frame_of


def stack(frames, part: str = "full") -> np.ndarray:
    return np.stack([frames(frame)[part] for frame in range(3)])


def test_frame_by_frame_is_what_the_metrics_say_of_the_whole_path(scene):
    pred, exposure = noisy(scene), 0.7
    new = compute(pred, scene, ["rmse", "dssim"], SEQUENCE, [exposure] * 3)
    reference = {part: stack(lambda f: reference_parts(scene, f), part) for part in ("full", "specular")}
    for part, ref in reference.items():
        row = metrics.evaluate(
            stack(pred, part), ref, metrics=["rmse", "dssim"], exposure=np.full(3, exposure)
        )
        for name in ("rmse", "dssim"):
            assert new["frames"][part][name] == pytest.approx(row[name].tolist(), rel=1e-12)
        read = [scene.half(0, f, "motion", "motion_valid", "shape_id", "position") for f in range(3)]
        motion = np.stack([r["motion"] for r in read])
        visible = metrics.visibility(
            motion, np.stack([r["shape_id"][..., 0] for r in read]), np.stack([r["position"] for r in read])
        ) & np.stack([r["motion_valid"][..., 0] > 0 for r in read])
        whole = metrics.evaluate_sequence(
            stack(pred, part), ref, metrics=SEQUENCE, motion=motion, visible=visible, exposure=exposure
        )
        for name, value in whole.items():
            if name != "exposure":
                assert new["sequences"][part]["walk"][name] == pytest.approx(value, rel=1e-12), name
    assert visible.any()


def test_the_reference_itself_has_no_error(scene):
    new = compute(
        lambda f: reference_parts(scene, f), scene, ["rmse", "dssim"], ["temporal_difference"], [1.0] * 3
    )
    for part in ("full", "specular"):
        assert new["frames"][part] == {"rmse": [0, 0, 0], "dssim": [0, 0, 0]}
        assert new["sequences"][part]["walk"]["temporal_difference"] == 0


def test_the_two_renderings_are_independent_and_agree_on_what_is_seen(scene):
    for frame in range(3):
        seen = ("position", "shape_id", "motion")
        first, second = (scene.half(which, frame, "color", "color_se", *seen) for which in (0, 1))
        for name in seen:
            np.testing.assert_array_equal(first[name], second[name])
        spread = np.sqrt(first["color_se"] ** 2 + second["color_se"] ** 2)
        moved = ((first["color"] - second["color"]) / np.maximum(spread, 1e-20))[spread > 0]
        assert len(moved) > 300
        # Of the difference of two independent estimates, in units of its standard error.
        assert moved.std() == pytest.approx(1, abs=0.2)


def test_the_noise_floor_is_the_distance_of_one_rendering_to_the_mean(scene, results):
    floor = results.floor
    assert set(floor["part"]) == {"full", "specular"}
    for part in ("full", "specular"):
        halves = [half_parts(scene, which, 1)[part] for which in (0, 1)]
        rows = floor[(floor["metric"] == "rmse") & (floor["frame"] == 1) & (floor["part"] == part)]
        assert rows["value"].item() == pytest.approx(
            0.5 * np.sqrt(np.mean((halves[0] - halves[1]) ** 2, dtype=np.float64)), rel=1e-5
        )
        assert rows["value"].item() > 0


def test_all_frames_share_the_exposure_of_the_references(results, scene):
    whole = stack(lambda f: reference_parts(scene, f))
    shared = metrics.reference_exposure(whole, shared=True)
    assert [results.exposure("room-000000", frame) for frame in range(3)] == [shared] * 3
    label = results.results.set_index("label")["result"]
    id = label["constant shade=1"]
    frames = results.frames
    for part, shade in (("full", 1.0), ("specular", 0.5)):
        value = frames[
            (frames["result"] == id)
            & (frames["metric"] == "rmse_display")
            & (frames["part"] == part)
            & (frames["frame"] == 2)
        ]["value"].item()
        reference = reference_parts(scene, 2)[part]
        shown = [
            metrics.tone_map(image, results.exposure("room-000000", 2))
            for image in (np.full_like(reference, shade), reference)
        ]
        assert value == pytest.approx(
            np.sqrt(np.mean((shown[0] - shown[1]) ** 2, dtype=np.float64)), rel=1e-6
        )


def test_only_what_is_missing_is_computed(copy, monkeypatch):
    asked = []
    monkeypatch.setattr(scoring, "compute", lambda *a: asked.append(a[2:4]) or compute(*a))
    monkeypatch.setattr(scoring, "default_threads", lambda workers: 1)
    assert score(copy).done == 0
    before = {path.name: json.loads(path.read_text()) for path in copy.scores.iterdir()}
    assert score(copy, more=["relmse", "mabd"]).done == 7  # six results and the noise of one scene
    assert asked == [(["relmse"], ["mabd"])] * 7
    for path in copy.scores.iterdir():
        now = json.loads(path.read_text())
        for part, rows in before[path.name]["frames"].items():
            assert {name: now["frames"][part][name] for name in rows} == rows
            assert set(now["frames"][part]) - set(rows) == {"relmse"}
    copy.score_file(copy.ids()[0]).unlink()
    assert score(copy).done == 1


def test_predictions_and_results_are_left_as_they_were(copy):
    before = {path: path.read_bytes() for path in copy.results.rglob("*") if path.is_file()}
    score(copy, more=["psnr"])
    assert {path: path.read_bytes() for path in copy.results.rglob("*") if path.is_file()} == before


def test_a_metric_that_cannot_be_computed_is_named_with_the_reason(copy, monkeypatch, tmp_path):
    monkeypatch.setenv("GIBENCH_CACHE", str(tmp_path / "nothing"))
    scored = score(copy, more=["lpips_alex"])
    reason, count = scored.skipped["lpips_alex"]
    assert count == 7
    assert "gibench.metrics.lpips_weights" in reason or "not installed" in reason
    assert score(copy, more=["lpips_alex"]).done == 0  # said once
    assert "lpips_alex" in json.loads(copy.score_file(copy.ids()[0]).read_text())["skipped"]


def test_what_these_frames_can_never_have_is_computed_once(copy, monkeypatch):
    """A room without a sequence has no temporal metric, and scoring again must not read all of its frames for that."""
    monkeypatch.setattr(scoring, "default_threads", lambda workers: 1)
    plain = compute

    def without(frames, scene, image, sequence, *more):
        why = "there is no sequence of two frames or more"
        found = plain(frames, scene, image, [], *more)
        return found | {"skipped": dict.fromkeys(sequence, why), "lasting": list(sequence)}

    monkeypatch.setattr(scoring, "compute", without)
    assert score(copy, more=["mabd"]).skipped["mabd"][1] == 7
    assert score(copy, more=["mabd"]).done == 0
    path = copy.score_file(copy.ids()[0])
    scores = json.loads(path.read_text())
    path.write_text(json.dumps(scores | {"codes": scores["codes"] | {"mabd": "edited"}}))
    assert score(copy, more=["mabd"]).done == 1


def test_images_that_are_too_small_are_such_a_reason():
    reasons, small = scoring._impossible(np.zeros((8, 20, 3), np.float32), ["rmse", "dssim", "flip"])
    assert list(reasons) == ["dssim"]
    assert small == {"dssim"}
    assert "needs at least 11×11" in reasons["dssim"]


def test_an_unknown_metric(copy):
    with pytest.raises(metrics.UnknownMetricError, match="no metric is named 'rmsee'"):
        score(copy, more=["rmsee"])


def test_a_damaged_prediction_and_a_damaged_result_are_named_and_the_rest_is_scored(copy):
    first, second, *_ = copy.ids()
    (copy.predictions(first) / "0001.exr").write_bytes(b"nothing")
    copy.score_file(first).unlink()
    copy.result_file(second).write_text("{")
    copy.score_file(copy.ids()[3]).unlink()
    scored = score(copy)
    assert scored.done == 1
    assert len(scored.problems) == 2
    assert any(f"{first}.json: its frame 0001.exr was changed" in problem for problem in scored.problems)
    assert any(f"{second}.json is damaged" in problem for problem in scored.problems)
    assert copy.score_file(copy.ids()[3]).exists()


def test_a_damaged_score_file_is_named(copy):
    path = copy.score_file(copy.ids()[0])
    path.write_text(path.read_text()[:50])
    with pytest.raises(ResultsError, match=r"is damaged .*remove it and run `gibench bench score"):
        score(copy)


def test_what_json_lacks_is_none():
    assert scoring._finite({"a": [1.0, float("nan"), float("inf")], "b": "x"}) == {
        "a": [1.0, None, None],
        "b": "x",
    }


@dataclass
class Stopped:
    """Scoring whose process is stopped at one of the units, the first `times` times."""

    job: Callable
    tries: Path
    times: int

    def __call__(self, unit, report):
        if unit == 1:
            tries = self.tries.stat().st_size if self.tries.exists() else 0
            self.tries.write_text("x" * (tries + 1))
            if tries < self.times:
                os.kill(os.getpid(), signal.SIGSTOP)
        return self.job(unit, report)


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="needs SIGSTOP")
@pytest.mark.parametrize("times", [1, 2])
def test_a_process_that_hangs_is_given_up_and_its_result_scored_again(copy, tmp_path, monkeypatch, times):
    monkeypatch.setattr(pool, "PATIENCE", 3)
    monkeypatch.setattr(pool, "LOOK_SECONDS", 0.2)
    monkeypatch.setattr(scoring, "default_threads", lambda workers: 2)
    work_of = scoring._work

    def work(units):
        whole = work_of(units)
        return replace(whole, job=Stopped(whole.job, tmp_path / "tries", times))

    monkeypatch.setattr(scoring, "_work", work)
    scores = {path.name: path.read_bytes() for path in copy.scores.iterdir()}
    shutil.rmtree(copy.scores)
    remarks = []
    if times == 2:
        with pytest.raises(
            RunError, match=r"^result \w+: two workers in a row were given up, since each hung"
        ):
            score(copy, told=remarks.append)
        monkeypatch.undo()
        score(copy)
    else:
        assert score(copy, told=remarks.append).problems == ()
    assert len(remarks) == times
    assert "its worker hangs: it has not computed anything for 3 s; once more in a new one" in remarks[0]
    assert {path.name: path.read_bytes() for path in copy.scores.iterdir()} == scores


def test_a_metric_whose_code_changed_is_computed_anew(copy, monkeypatch):
    """A mended metric beside values of before would be two metrics of one name on one board."""
    assert score(copy).done == 0
    before = scoring.code_of
    monkeypatch.setattr(scoring, "default_threads", lambda workers: 1)
    monkeypatch.setattr(scoring, "code_of", lambda name: before(name) if name != "dssim" else "0" * 16)
    asked = []
    monkeypatch.setattr(scoring, "compute", lambda *a: asked.append(a[2:4]) or compute(*a))
    assert score(copy).done == 7
    assert asked == [(["dssim"], [])] * 7
    assert json.loads(copy.score_file(copy.ids()[0]).read_text())["codes"]["dssim"] == "0" * 16
    assert score(copy).done == 0


@pytest.mark.parametrize("name", ["rmse", "dssim", "warping_error"])
def test_the_key_of_a_score_is_of_all_that_decides_it(name):
    sources_of_it = sources.sources(module_of(metrics.metric(name).function))
    assert metrics.metric(name).function.__module__ in sources_of_it
    shared = {module for one in scoring.SHARED for module in sources.sources(one)}
    assert {"gibench.metrics.tone_map", "gibench.metrics.unbiased", "gibench.metrics.reprojection"} <= shared


@pytest.fixture
def noisy_scene(scene, tmp_path):
    """The scene with references that were denoised, badly, beside samples that were not, and the truth behind both."""
    rng = np.random.default_rng(1)
    truth, halves = {}, ([], [])
    for frame in range(len(scene)):
        arrays = scene.half(0, frame, *PARTS, *MOVING)
        truth[frame] = {name: np.maximum(arrays[name], 0.05).astype(np.float32) for name in PARTS}
        for which in (0, 1):
            noise = {
                name: rng.gamma(20, 0.05, truth[frame][name].shape).astype(np.float32)
                for name in SAMPLED.values()
            }
            sampled = {name: truth[frame][part] * noise[part] for name, part in SAMPLED.items()}
            # Too dark, and what noise is left is that of the samples.
            shown = {part: 0.9 * truth[frame][part] * noise[part] ** 0.2 for part in SAMPLED.values()}
            file = {**arrays, **truth[frame], **shown, **sampled}
            file["color"] = sum(file[part] for part in PARTS)
            path = tmp_path / f"{which}-{frame}.exr"
            path.write_bytes(encode(file))
            halves[which].append(path)
    return replace(scene, halves=tuple(map(tuple, halves))), truth


def test_quadratic_metrics_are_against_the_truth_where_samples_are_kept(noisy_scene):
    """A darker reference flatters darker images; its samples tell the true error, of images and of itself."""
    scene, truth = noisy_scene
    names, full = ["rmse", "mse", "flip"], [sum(truth[frame][part] for part in PARTS) for frame in range(3)]
    for shade in (1.1, 0.8):
        found = compute(
            lambda frame, shade=shade: {"full": (shade * full[frame]).astype(np.float32)},
            scene,
            names,
            [],
            [1.0] * 3,
        )
        assert found["unbiased"] == ["rmse", "mse"]
        assert not found["clipped"]
        wrong = []
        for frame in range(3):
            image = (shade * full[frame]).astype(np.float32)
            true = metrics.evaluate(image, full[frame], metrics=["mse"])["mse"]
            assert found["frames"]["full"]["mse"][frame] == pytest.approx(true, rel=0.25)
            assert found["frames"]["full"]["rmse"][frame] == found["frames"]["full"]["mse"][frame] ** 0.5
            reference = reference_parts(scene, frame)["full"]
            wrong.append(metrics.evaluate(image, reference, metrics=["mse"])["mse"] / true)
        assert np.mean(wrong) > 1.5 or np.mean(wrong) < 0.6
    floor = compute(None, scene, names, [], [1.0] * 3)
    true = np.mean(
        [
            metrics.evaluate(reference_parts(scene, f)["full"], full[f], metrics=["mse"])["mse"]
            for f in range(3)
        ]
    )
    assert floor["frames"]["full"]["mse"] == [pytest.approx(true, rel=0.25)] * 3
    by_halves = np.mean(
        [
            metrics.evaluate(
                half_parts(scene, 0, f)["full"], reference_parts(scene, f)["full"], metrics=["mse"]
            )["mse"]
            for f in range(3)
        ]
    )
    assert by_halves < 0.5 * true


def test_references_without_samples_are_scored_as_before(scene):
    found = compute(noisy(scene), scene, ["rmse", "dssim"], [], [1.0] * 3)
    assert found["unbiased"] == []
    assert found["clipped"] == {}
