"""The curve of a real training reaches the tables."""

import json

import numpy as np
import pytest

from gibench.baselines.efficient_light_probes import METHOD
from gibench.baselines.trained import CURVE
from gibench.benchmarks.registry import Found
from gibench.benchmarks.report.runs import Runs
from gibench.benchmarks.result_files import RunFolder
from gibench.benchmarks.results import load
from gibench.benchmarks.running import run
from tests.benchmarks.conftest import order

SMALL = {
    "epochs": 2,
    "crop": 32,
    "lpips": False,
    "temporal": False,
    "texels": 4,
    "lightmap_spp": 16,
    "lightmap_denoise": False,
    "probes": 8,
    "probe_width": 64,
    "probe_spp": 1,
}


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A run of efficient light probes in a tiny room, with two settings of a knob that does not bake."""
    root = tmp_path_factory.mktemp("trained")
    overrides = {"elp": {name: (value,) for name, value in SMALL.items()} | {"rays": (1, 4)}}
    report = run(root, order(Found(METHOD, "gibench", "1"), overrides=overrides))
    assert not report.failed
    return root


def test_the_curve_of_a_real_training_reaches_the_tables(trained):
    results = load(trained)
    (folder,) = {
        path.parent
        for path in RunFolder(trained).root.rglob(CURVE)
        if path.parent.name.startswith("training")
    }
    record = json.loads((folder / CURVE).read_text())
    written = record["curve"]
    curves = results.curves
    assert set(curves["result"]) == set(results.results["result"])
    for _, own in curves.groupby("result"):
        assert own["step"].tolist() == [look["step"] for look in written] == [0, 1, 2]
        assert own["error"].to_numpy() == pytest.approx([look["error"] for look in written])
        assert own.loc[own["kept"], "step"].tolist() == [record["best"]["step"]]
        assert np.all(np.diff(own["seconds"]) > 0)
        assert np.isfinite(own["error"]).all()
        assert (own["error"] > 0).all()
    assert Runs([results]).curves.equals(curves)
