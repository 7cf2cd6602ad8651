"""Trainings are judged under light that they never see."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from gibench.baselines.relighting.held_out import held_out, spread
from gibench.baselines.training.errors import TrainingError


class Views(SimpleNamespace):
    def __len__(self):
        return len(self.frames)


def views(maps, count, rooms=1, seed=0):
    """Frames under maps of some names, each drawn for itself, as the track makes them."""
    drawn = np.random.default_rng(seed).integers(len(maps), size=count)
    table = {
        "room": np.arange(count) * rooms // count,
        "environment": [maps[k] for k in drawn],
        "environment_sha256": [f"{k:064x}" for k in drawn],
        "environment_rotation": np.arange(count) % 3,
    }
    return Views(frames=pd.DataFrame(table), rooms=tuple(range(rooms)))


def hashes(one, numbers):
    return set(one.frames["environment_sha256"].iloc[numbers])


REAL = [*"abcdefghijk", "studio", "vestibule", "warehouse", "workshop"]
RENDERED = [f"room-204-{number:05d}" for number in range(100)]


@pytest.mark.parametrize("seed", range(4))
def test_no_light_that_is_judged_by_is_learned_from(seed):
    made = views(REAL + RENDERED, 475, seed=seed)
    learned, judged = held_out(made, 0.05, 24)
    assert not hashes(made, learned) & hashes(made, judged)
    assert 0.9 < len(learned) / 475 < 0.99
    assert 8 <= len(judged) <= 24
    assert max(judged) - min(judged) > 475 / 2
    names = set(made.frames["environment"].iloc[judged])
    assert names & set(REAL)
    assert names & set(RENDERED)


def test_a_share_of_the_maps_is_spread_over_their_names():
    names = {f"{number:064x}": name for number, name in enumerate(REAL + RENDERED)}
    apart = [names[one] for one in spread(names, 0.05)]
    assert len(apart) == 6
    assert {"a", "workshop"} <= set(apart)
    assert len(spread(names, 0.0)) == 1


@pytest.mark.parametrize(("maps", "count", "rooms"), [(1, 6, 1), (3, 6, 1), (1, 2, 1), (9, 12, 2)])
def test_few_maps_and_several_rooms_have_views_or_rooms_held_out(maps, count, rooms):
    learned, judged = held_out(views(REAL[:maps], count, rooms), 0.05, 24)
    assert learned + judged == list(range(count))
    assert len(judged) == (6 if rooms > 1 else 1)


def test_frames_without_environments_and_single_ones():
    bare = Views(frames=pd.DataFrame({"room": [0] * 6}), rooms=(0,))
    dark = Views(frames=bare.frames.assign(environment=None, environment_sha256=None), rooms=(0,))
    for one in (bare, dark):
        assert held_out(one, 0.05, 24) == ([0, 1, 2, 3, 4], [5])
    with pytest.raises(TrainingError, match="but there are 1"):
        held_out(views(REAL, 1), 0.05, 24)
