import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from gibench import metrics
from gibench.benchmarks import statistics
from gibench.benchmarks.errors import ResultsError
from gibench.benchmarks.statistics import difference, floor, leaderboard, verdict

ROOMS, FRAMES = 6, 5


def fake(
    errors: dict[str, float],
    *,
    noise: float = 0.01,
    seeds=(0,),
    machines=("m",),
    name: str = "rmse",
    unbiased=(),
):
    """Results of methods whose error in frame f of room r is known; only tables, as `Results` gives them."""
    rng = np.random.default_rng(0)
    level = rng.uniform(0.5, 1.5, (ROOMS, FRAMES))
    rows, frames = [], []
    for label, error in errors.items():
        for room in range(ROOMS):
            for seed in seeds:
                for machine in machines:
                    id = f"{label}{room}{seed}{machine}"
                    rows.append(
                        {
                            "result": id,
                            "label": label,
                            "method": label.split()[0],
                            "title": label,
                            "family": "f",
                            "scene": f"room-{room}",
                            "seed": seed,
                            "machine": machine,
                            "status": "ok",
                            "ms_median": 10.0 * (1 + room) * (1 + machines.index(machine)),
                            "ms_p95": 20.0,
                            "prepare_s": 1.0,
                            "bytes": 5.0,
                            "peak_mb": 3.0,
                        }
                    )
                    frames += [
                        (id, f, 1.0, name, "full", error * level[room, f] + 0.001 * seed)
                        for f in range(FRAMES)
                    ]
    return SimpleNamespace(
        root="R",
        skipped={},
        results=pd.DataFrame(rows),
        frames=pd.DataFrame(frames, columns=["result", "frame", "ms", "metric", "part", "value"]),
        sequences=pd.DataFrame(columns=["result", "sequence", "metric", "part", "value"]),
        floor=pd.DataFrame(
            [(f"room-{r}", f, name, "full", noise) for r in range(ROOMS) for f in range(FRAMES)],
            columns=["scene", "frame", "metric", "part", "value"],
        ),
        unbiased=frozenset(unbiased),
        records=lambda: [{"config": {"scene": f"room-{r}", "scene_sha256": str(r)}} for r in range(ROOMS)],
        level=level,
    )


def test_the_board_is_in_order_with_intervals_over_rooms():
    results = fake({"good": 0.1, "bad": 0.3, "middling": 0.2})
    board = leaderboard(results, "rmse")
    assert list(board["label"]) == ["good", "middling", "bad"]
    row = board.iloc[0]
    expected = metrics.mean_interval(
        (0.1 * results.level).ravel(), np.repeat([f"room-{r}" for r in range(ROOMS)], FRAMES)
    )
    assert (row["mean"], row["low"], row["high"], row["rooms"]) == (
        expected.mean,
        expected.low,
        expected.high,
        ROOMS,
    )
    assert row["ms"] == 35.0


def test_better_may_be_higher():
    results = fake({"a": 20.0, "b": 30.0}, name="psnr")
    assert list(leaderboard(results, "psnr")["label"]) == ["b", "a"]


def test_times_of_two_machines_are_never_averaged():
    board = leaderboard(fake({"a": 0.1}, machines=("fast", "slow")), "rmse")
    assert dict(zip(board["machine"], board["ms"], strict=True)) == {"fast": 35.0, "slow": 70.0}


def test_a_method_that_always_failed_comes_last():
    results = fake({"good": 0.1, "gone": 0.0})
    gone = results.results["label"] == "gone"
    results.results.loc[gone, "status"] = "failed"
    results.results.loc[gone, ["ms_median", "ms_p95"]] = np.nan
    results.frames = results.frames[results.frames["result"].str.startswith("good")]
    board = leaderboard(results, "rmse")
    assert list(board["label"]) == ["good", "gone"]
    assert board["failed"].tolist() == [0, ROOMS]
    assert np.isnan(board["mean"].iloc[1])


def test_paired_differences_and_their_verdicts():
    results = fake({"a": 0.10, "b": 0.15})
    found = difference((results, "a"), (results, "b"), "rmse", "full")
    assert found.interval.mean == pytest.approx((-0.05 * results.level).mean())
    assert found.verdict == "better"
    assert difference((results, "b"), (results, "a"), "rmse", "full").verdict == "worse"
    assert difference((results, "a"), (results, "a"), "rmse", "full").verdict == "unsure"
    assert difference((results, "b"), (results, "a"), "rmse", "full").floor == pytest.approx(0.01)


def test_no_difference_below_the_noise_floor_is_called_one():
    results = fake({"a": 0.10, "b": 0.15}, noise=0.06)
    found = difference((results, "a"), (results, "b"), "rmse", "full")
    assert found.interval.excludes_zero
    assert found.verdict == "below the noise floor"


def test_what_is_against_the_truth_does_not_depend_on_the_reference():
    """Its noise is in the interval; two runs of which one is against the reference are compared as that is."""
    results = fake({"a": 0.10, "b": 0.15}, noise=0.06, unbiased=["rmse"])
    found = difference((results, "a"), (results, "b"), "rmse", "full")
    assert np.isnan(found.floor)
    assert found.verdict == "better"
    before = fake({"a": 0.10, "b": 0.15}, noise=0.06)
    assert difference((results, "a"), (before, "b"), "rmse", "full").verdict == "below the noise floor"


def test_the_floor_is_a_distance_from_the_perfect_value():
    assert floor(fake({"a": 0.1}, noise=0.02), "rmse", "full") == pytest.approx(0.02)
    assert floor(fake({"a": 0.9}, noise=0.97, name="ssim"), "ssim", "full") == pytest.approx(0.03)
    assert np.isnan(floor(fake({"a": 30.0}, noise=40.0, name="psnr"), "psnr", "full"))
    assert np.isnan(floor(fake({"a": 0.1}), "rmse", "specular"))


def test_verdicts_need_both_a_sure_sign_and_a_size():
    def interval(mean, half):
        return metrics.Interval(mean, mean - half, mean + half, 0.95, 5, 5)

    assert verdict(interval(-1, 0.5), 0.1, "lower") == "better"
    assert verdict(interval(-1, 0.5), 0.1, "higher") == "worse"
    assert verdict(interval(-1, 1.5), 0.1, "lower") == "unsure"
    assert verdict(interval(-1, 0.5), 1.1, "lower") == "below the noise floor"
    assert verdict(interval(-1, 0.5), float("nan"), "lower") == "better"


def test_seeds_are_averaged_before_frames_are_paired():
    results = fake({"a": 0.1, "b": 0.2}, seeds=(0, 1, 2))
    found = difference((results, "a"), (results, "b"), "rmse", "full")
    assert found.interval.frames == ROOMS * FRAMES
    assert found.interval.mean == pytest.approx((-0.1 * results.level).mean())


def test_a_frame_that_one_seed_lacks_is_not_compared():
    results = fake({"a": 0.1, "b": 0.2}, seeds=(0, 1))
    gone = (results.frames["result"] == "a00m") & (results.frames["frame"] == 2)
    assert gone.sum() == 1
    results.frames.loc[gone, "value"] = np.nan
    found = difference((results, "a"), (results, "b"), "rmse", "full")
    assert found.interval.frames == ROOMS * FRAMES - 1


def test_runs_are_paired_by_what_the_scenes_hold():
    first, second = fake({"a": 0.1}), fake({"a": 0.1})
    second.records = lambda: [
        {"config": {"scene": f"room-{r}", "scene_sha256": f"x{r}"}} for r in range(ROOMS)
    ]
    with pytest.raises(ResultsError, match="share no frame with a rmse of the full image"):
        difference((first, "a"), (second, "a"), "rmse", "full")


def test_what_was_not_computed_or_is_not_there_is_named():
    results = fake({"path spp=1": 0.1, "path spp=2": 0.2})
    results.run = {"metrics": ["rmse", "dssim"], "sequence_metrics": ["mabd"]}
    for name, command in (("dssim", "score R"), ("flip", "score R --metrics flip")):
        with pytest.raises(
            ResultsError, match=f"has no {name} of the full image: `gibench bench {command}` computes it"
        ):
            leaderboard(results, name)
    results.skipped = {"dssim": "images are too small"}
    with pytest.raises(ResultsError, match="has no dssim of the full image: images are too small"):
        leaderboard(results, "dssim")
    assert statistics.labels_of(results, "path") == ["path spp=1", "path spp=2"]
    assert statistics.labels_of(results, "path spp=2") == ["path spp=2"]
    with pytest.raises(ResultsError, match=r"no method 'pth spp=1'; did you mean 'path spp=1'"):
        statistics.labels_of(results, "pth spp=1")


def test_a_real_run(results):
    board = leaderboard(results, "rmse", "specular")
    assert set(board["label"]) == {
        f"constant shade={shade}{style}" for shade in ("0.25", "1") for style in ("", " fancy")
    }.union({"plain shade=0.5", "plain shade=2"})
    assert board.set_index("label")["mean"].isna().sum() == 2  # has no specular part
    temporal = leaderboard(results, "temporal_difference")
    assert temporal["mean"].notna().all()
    found = difference((results, "constant shade=0.25"), (results, "plain shade=2"), "rmse", "full")
    assert found.verdict == "better"
    assert json.loads(json.dumps(found.interval.rooms)) == 1
