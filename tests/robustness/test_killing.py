"""A few kills; see `killing` for fifty of every command."""

from __future__ import annotations

import os
import random

import pytest

from tests.robustness.killing import killed

SEED = int(os.environ.get("GIBENCH_KILL_SEED", random.SystemRandom().randrange(2**32)))
KILLS = int(os.environ.get("GIBENCH_KILLS", "6"))


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="needs process groups")
def test_kills_lose_nothing():
    """With a renderer that takes no time."""
    outcome = killed("make-fake", KILLS, SEED)
    print(f"seed {SEED}, {outcome.kills} kills")
    assert outcome.kills == KILLS
    assert outcome.lost == [], f"seed {SEED}"
