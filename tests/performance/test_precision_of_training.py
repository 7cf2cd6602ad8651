"""What networks learn in bfloat16 beside single precision, in the same steps from the same views."""

from __future__ import annotations

import json
import statistics

import pytest

from gibench.baselines.image_to_image import implementation as images
from gibench.baselines.method import Training
from gibench.baselines.neural_free_viewpoint_relighting.implementation import NeuralRelighting
from gibench.baselines.stages import Stages
from gibench.baselines.training import precision
from gibench.baselines.training_set import training_set
from gibench.benchmarks.registry import installed
from gibench.datasets.making import make
from gibench.datasets.recipes import check_recipe

pytestmark = pytest.mark.performance

VIEWS = {
    "nfvr": {
        "rooms": 1,
        "kinds": ["still-life"],
        "lighting": "environments",
        "views": 100,
        "resolution": [64, 64],
    },
    "gfa": {"rooms": 24, "views": 4, "resolution": [96, 64]},
}
KNOBS = {
    "nfvr": {"network": "small", "faces": 32, "table": 15, "batch": 512, "learned": 96},
    "gfa": {"width": 0.5, "crop": 64},
}
SEEDS = (0, 1, 2)
PASSES = 4
"""Of gfa over its views."""


@pytest.mark.parametrize("name", VIEWS)
def test_what_is_learned_in_bfloat16(name, tmp_path, monkeypatch):
    """Held-out errors, judged in single precision. On a processor without instructions for it this takes long."""
    recipe = {**VIEWS[name], "seed": 104, "spp": 64, "denoise": True, "channels": ["radiance", "surface"]}
    make(tmp_path / "views", check_recipe({**recipe, "splits": {"train": 1.0}}))
    views = training_set(tmp_path / "views")
    monkeypatch.setattr(images, "EPOCHS", PASSES)
    monkeypatch.setattr(NeuralRelighting, "steps", 2000)
    method = installed().get(name).method
    errors, begun = {True: [], False: []}, []
    for seed in SEEDS:
        for low, found in errors.items():
            monkeypatch.setattr(precision, "multiplies", lambda low=low: low)
            folder = tmp_path / f"{seed}-{low}"
            folder.mkdir()
            training = Training(views, None, seed, folder, tmp_path / f"{seed}-{low}.pt", Stages())
            method.load()(method.settings(KNOBS[name])).train(training)
            told = json.loads((folder / "training.json").read_text())
            found.append(min(look["error"] for look in told["curve"]))
            begun.append(told["curve"][0]["error"])
    low, single = (statistics.mean(errors[kind]) for kind in (True, False))
    spread = statistics.stdev(errors[False]) / single
    print(
        f"\n{name}, {told['steps']} steps: held-out error in bfloat16 {low / single:.3f} of single precision "
        f"({single:.4f}, which seeds spread by {100 * spread:.1f} %)"
    )
    assert max(low, single) < 0.8 * statistics.mean(begun)  # both learn
