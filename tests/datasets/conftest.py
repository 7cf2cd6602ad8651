from pathlib import Path

import pytest

from gibench.datasets.making import make
from gibench.rendering.channels import SETS
from tests.datasets.fakes import fake_work, tiny


@pytest.fixture(scope="session")
def rooms_made(tmp_path_factory) -> Path:
    """A dataset of 12 fake rooms with all channels; nobody may change it."""
    root = tmp_path_factory.mktemp("made") / "d"
    recipe = tiny(12, channels=tuple(SETS))
    make(root, recipe, command="make-dataset --rooms 12", work=fake_work(root, recipe))
    return root
