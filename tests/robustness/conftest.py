from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from gibench.benchmarks.result_files import RunFolder
from tests.robustness import samples


@pytest.fixture(scope="session")
def whole(tmp_path_factory) -> Path:
    """A folder with a dataset "ds" and a run "run"; nobody may change it."""
    root = tmp_path_factory.mktemp("whole")
    samples.dataset(root / "ds")
    samples.run(root / "run")
    return root


@pytest.fixture
def ds(whole, tmp_path) -> Path:
    """The same dataset, to be damaged."""
    return Path(shutil.copytree(whole / "ds", tmp_path / "ds"))


@pytest.fixture
def run(whole, tmp_path) -> RunFolder:
    """The same run, to be damaged."""
    return RunFolder(Path(shutil.copytree(whole / "run", tmp_path / "run")))
