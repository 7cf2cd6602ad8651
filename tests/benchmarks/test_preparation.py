"""What a preparation is said to cost."""

from pathlib import Path

import pandas as pd
import pytest

from gibench.baselines.bakes import Bake
from gibench.baselines.training_set import TrainingSet
from gibench.benchmarks.costs import preparation
from gibench.benchmarks.worker import method_seed
from gibench.datasets.loading import Dataset


def views(*handed_out: bool) -> TrainingSet:
    rows = [{"room": 0, "file": "none", "seconds": 10.0 * (i + 1)} for i in range(len(handed_out))]
    made = TrainingSet(Dataset(Path("none"), {}, pd.DataFrame(rows)))
    made.book([index for index, given in enumerate(handed_out) if given])
    return made


LIGHTMAP = Bake("lightmap", Path("a"), 5.0, 100)
PROBES = Bake("probes", Path("b"), 7.0, 200)


def test_who_finds_a_bake_pays_what_its_maker_paid():
    first = preparation(13.0, {}, [LIGHTMAP, PROBES], [LIGHTMAP, PROBES], [views()])
    second = preparation(1.0, {}, [LIGHTMAP, PROBES], [], [views()])
    for paid in (first, second):
        assert paid["lightmap"] == 5.0
        assert paid["probes"] == 7.0
        assert paid["seconds"] == pytest.approx(13.0)  # 1 s of reading and the like, whoever baked
        assert paid["bytes"] == 300


def test_training_views_cost_what_rendering_those_that_were_handed_out_took():
    paid = preparation(1.0, {"training": 0.75}, [], [], [views(True, False, True)])
    assert paid["references"] == 40.0
    assert paid["training"] == 0.75
    assert paid["other"] == 0.25
    assert paid["seconds"] == 41.0
    assert paid["training_views_read"] == 2


def test_time_counts_once_where_a_stage_holds_the_making_of_its_bake():
    paid = preparation(6.0, {"lightmap": 5.5}, [LIGHTMAP], [LIGHTMAP], [views()])
    assert paid["lightmap"] == pytest.approx(5.5)
    assert paid["seconds"] == pytest.approx(6.0)


def test_what_runs_spent_that_were_cut_off_is_paid_beside_this_one():
    training = Bake("training", Path("c"), 9.0, 100, before=4.0)
    paid = preparation(6.0, {}, [training], [training], [views()])
    assert paid["training"] == 9.0
    assert paid["other"] == pytest.approx(1.0)
    assert paid["seconds"] == pytest.approx(10.0)


def test_what_no_name_is_known_for_is_other():
    paid = preparation(3.0, {"sorting": 1.0}, [Bake("tables", Path("c"), 4.0, 8)], [], [views()])
    assert paid["other"] == pytest.approx(7.0)
    assert paid["seconds"] == pytest.approx(7.0)


def test_seeds_differ_by_seed_room_and_frame():
    seeds = {
        method_seed(seed, room, *frame) for seed in (0, 1) for room in (0, 1) for frame in ((), (0,), (1,))
    }
    assert len(seeds) == 12
    assert method_seed(3, 4, 5) == method_seed(3, 4, 5)
