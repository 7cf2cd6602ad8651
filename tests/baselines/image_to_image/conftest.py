"""A tiny room to learn from."""

from __future__ import annotations

from pathlib import Path

import pytest

from gibench.baselines.training_set import TrainingSet, training_set
from gibench.datasets.making import make
from gibench.datasets.recipes import check_recipe


@pytest.fixture(scope="session")
def room(tmp_path_factory) -> Path:
    """A dataset of four views of a room."""
    root = tmp_path_factory.mktemp("image-to-image") / "room"
    recipe = {"rooms": 1, "seed": 4, "kinds": ["bathroom"], "views": 4, "resolution": [40, 32], "spp": 8}
    make(root, check_recipe({**recipe, "channels": ["radiance", "surface"], "splits": {"test": 1.0}}))
    return root


@pytest.fixture
def views(room) -> TrainingSet:
    return training_set(room)
