"""What the methods of `moving-light` cost a frame, by stage, in a furnished room, beside denoised path tracing."""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path

import numpy as np
import pytest

from gibench.baselines.light_propagation_volumes import METHOD as LPV
from gibench.baselines.method import View
from gibench.baselines.neural_global_illumination import METHOD as NGI
from gibench.baselines.path_traced import METHOD as PATHS
from gibench.baselines.stages import Stages
from gibench.datasets.recipes import check_recipe
from gibench.datasets.room_making import LoadedRoom, sampled_room, written_room
from gibench.generators.shots import shot_of
from tests.baselines.compositional_scene_representations import test_implementation as cnnr
from tests.baselines.neural_global_illumination import test_implementation as ngi
from tests.baselines.radiance_regression import test_implementation as rrf
from tests.baselines.sites import site

pytestmark = pytest.mark.performance

RESOLUTION, FRAMES = (128, 128), 6

LONGEST = 0.5
"""Seconds of inference of the small network of `ngi` on two cores."""


@pytest.fixture(scope="module")
def loaded(tmp_path_factory) -> LoadedRoom:
    folder = Path(tmp_path_factory.mktemp("room"))
    recipe = check_recipe({"kinds": ["living"], "gloss": "much", "lighting": "area-light", "views": FRAMES})
    room = sampled_room(recipe, 0)
    written_room(room, folder, recipe)
    return LoadedRoom.of(recipe, room, folder)


def methods(loaded, folder):
    rig = loaded.rig
    at = dataclasses.replace(site(loaded.scene, folder), rig=rig, resolution=RESOLUTION)
    full = NGI.load()(NGI.settings({"network": "small"}))
    full.prepare(dataclasses.replace(at, weights=ngi.untrained(folder / "ngi")))
    volume = LPV.load()(LPV.settings({"cells": 16, "steps": 32}))
    volume.prepare(at)
    paths = PATHS.load()(PATHS.settings({"spp": 16}))
    paths.prepare(at)
    parts = rrf.prepared(rig, rrf.untrained(folder / "rrf"), folder)
    return {
        "ngi": full,
        "rrf": parts,
        "cnnr": cnnr.untrained(rig, folder),
        "lpv": volume,
        "path-traced": paths,
    }


def test_stages_of_a_frame(loaded, tmp_path):
    for name in ("ngi", "rrf"):
        (tmp_path / name).mkdir()
    shots = [shot_of(loaded.room, k) for k in range(FRAMES)]
    print(f"\n{RESOLUTION[0]} × {RESOLUTION[1]}, ms a frame, medians of {FRAMES - 2} frames:")
    total = {}
    inference = 0.0
    for name, method in methods(loaded, tmp_path).items():
        rows, wall = [], []
        for number, shot in enumerate(shots):
            loaded.rig.set(shot.lighting)
            stages = Stages()
            started = time.perf_counter()
            method.render(View(shot, None, RESOLUTION, number, number), stages).finish()
            wall.append(time.perf_counter() - started)
            rows.append(stages.seconds)
        total[name] = float(np.median(wall[2:]))
        found = {stage: float(np.median([row[stage] for row in rows[2:]])) for stage in rows[-1]}
        told = ", ".join(f"{stage} {1e3 * seconds:.0f}" for stage, seconds in found.items())
        print(f"{name}: {1e3 * total[name]:.0f} ({told})")
        if name == "ngi":
            inference = found["inference"]
    shares = ", ".join(f"{name} {total[name] / total['path-traced']:.2f}" for name in total)
    print(f"in frames of path-traced (16 spp, denoised): {shares}")
    assert inference <= LONGEST
