import os
from pathlib import Path

import numpy as np
import pytest

from gibench.metrics import WeightsError, fetch_weights


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(2024)


@pytest.fixture(scope="session")
def examples() -> dict[str, np.ndarray]:
    """The example images of the LPIPS repository: (64, 64, 3) in [0, 1]."""
    folder = os.environ.get("GIBENCH_EXTERNAL")
    if not folder:
        pytest.skip("GIBENCH_EXTERNAL is unset: the known-answer images are not here")
    from PIL import Image

    names = ("ref", "p0", "p1")
    paths = [Path(folder) / "metrics" / f"ex_{name}.png" for name in names]
    return {
        name: np.asarray(Image.open(path).convert("RGB")) / 255.0
        for name, path in zip(names, paths, strict=True)
    }


@pytest.fixture(scope="session")
def lpips_ready() -> None:
    """LPIPS with its packages and real weights."""
    pytest.importorskip("torch", reason="torch comes with gibench[bench]")
    try:
        fetch_weights()
    except WeightsError as error:
        pytest.skip(f"the LPIPS weights are not cached and cannot be fetched: {error}")
