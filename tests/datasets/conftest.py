from pathlib import Path

import pytest

from gibench.datasets.making import make
from tests.datasets.fakes import fake_work, tiny


@pytest.fixture(scope="session")
def rooms_made(tmp_path_factory) -> Path:
    """A dataset of 12 fake rooms with all channels; nobody may change it."""
    root = tmp_path_factory.mktemp("made") / "d"
    recipe = tiny(12, channels=("radiance", "surface", "reflection", "curvature", "motion"))
    make(root, recipe, command="make-dataset --rooms 12", work=fake_work(root, recipe))
    return root
