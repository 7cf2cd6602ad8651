"""Trainings are counted once, named as their settings are, and keep every look."""

import numpy as np
import pandas as pd

from gibench.benchmarks.report.summary import summarise
from gibench.benchmarks.report.trainings import family_of, trainings
from tests.benchmarks.report.synthetic import Setting, SyntheticRun


def made(root, *chosen, change=None, **more):
    run = SyntheticRun(root, chosen=chosen, frames=1, metrics=("rmse",), measured=False, **more)
    if change is not None:
        run.curves = change(run, run.curves)
    return trainings(run, summarise(run))


def network(method, knobs=None, shown="", **more):
    return Setting(method, knobs or {}, shown, kind="network", **more)


def test_a_training_of_each_room_seed_and_setting(tmp_path):
    curves = made(
        tmp_path, network("a"), network("a:plain"), Setting("rtrt", kind="lightmap"), scenes=2, seeds=(1, 2)
    )
    assert [(c.name, c.scenes, c.seed) for c in curves] == [
        (name, (scene,), seed)
        for name in ("a", "a:plain")
        for scene in ("room-000000", "room-000001")
        for seed in (1, 2)
    ]
    assert {c.family for c in curves} == {"a"} == {family_of("a:plain")}
    assert all(len(c.steps) == len(c.seconds) == len(c.errors) == 12 for c in curves)


def shared(run, table):
    """Every result has the looks of the first: one training for all rooms and settings."""
    first = table[table["result"] == table["result"].iloc[0]]
    return pd.concat([first.assign(result=result) for result in run.results["result"]], ignore_index=True)


def test_a_training_that_several_results_use_is_one(tmp_path):
    steps = [network("a", {"k": k, "s": "x"}, f"k={k}") for k in (1, 2)]
    (curve,) = made(tmp_path, *steps, scenes=3, change=shared)
    assert (curve.name, curve.scenes) == ("a", ("room-000000", "room-000001", "room-000002"))
    others = [network("a", {"s": s}, f"s={s}") for s in "xy"]
    (curve,) = made(tmp_path, *others, scenes=1, change=shared)
    assert curve.name == "a, 2 settings"


def test_a_name_does_not_hang_on_the_room_in_which_a_setting_failed(tmp_path):
    def of_room(run, table):
        rows = [table[table["result"] == result] for result in run.results["result"]]
        # The second setting uses the training of the first in the first room, and failed in the other.
        second = run.results["result"].iloc[2]
        return pd.concat([rows[0], rows[1], rows[0].assign(result=second)])

    steps = [network("a", {"k": k}, f"k={k}") for k in (1, 2)]
    curves = made(tmp_path, *steps, scenes=2, failed=("a k=2",), change=of_room)
    assert [(curve.name, curve.scenes) for curve in curves] == [
        ("a", ("room-000000",)),
        ("a", ("room-000001",)),
    ]


def test_two_trainings_of_one_result_have_a_name_each(tmp_path):
    def twice(_, table):
        return pd.concat([table, table.assign(training=1, error=2 * table["error"])])

    names = [curve.name for curve in made(tmp_path, network("a"), scenes=1, change=twice)]
    assert names == ["a, training 1", "a, training 2"]


def test_the_best_look_is_the_earliest_of_the_smallest_finite_ones(tmp_path):
    def errors(*values):
        return lambda _, table: table.assign(error=values)

    def best(*values):
        (curve,) = made(tmp_path, network("a"), scenes=1, looks=len(values), change=errors(*values))
        assert np.isfinite(curve.errors).sum() == np.isfinite(values).sum()
        return curve.best

    assert best(3.0, 1.0, 1.0, 2.0) == 1
    assert best(np.nan, 2.0, -np.inf, np.inf) == 1
    assert best(np.nan, np.inf) is None


def test_times_of_two_machines_are_two_trainings_and_nothing_trained_is_none(tmp_path):
    curves = made(tmp_path, network("a"), scenes=1, machines=("m1", "m2"))
    assert len({curve.machine for curve in curves}) == len(curves) == 2
    assert made(tmp_path, Setting("rtrt", kind="lightmap")) == []


def test_curves_of_no_result_are_left_out(tmp_path):
    assert made(tmp_path, network("a"), scenes=1, change=lambda _, table: table.iloc[:0]) == []
    assert made(tmp_path, network("a"), scenes=1, change=lambda _, table: table.assign(result="?")) == []
