"""From files to frames: the networks of the track learn from a dataset, repeat, and are found again."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import torch

from gibench.baselines.bakes import BakeCache
from gibench.baselines.method import Training, View
from gibench.baselines.stages import Stages
from gibench.baselines.training import artifacts
from gibench.baselines.training_set import training_set
from gibench.benchmarks.registry import installed
from gibench.datasets.loading import open_dataset
from gibench.datasets.making import make
from gibench.datasets.recipes import check_recipe
from gibench.rendering.light_rig import LightRig
from gibench.rendering.lighting import Lighting, Shot
from gibench.rendering.scene import load_scene
from tests.baselines.sites import site

RESOLUTION = (32, 24)
STEPS = 3
SETTINGS = {
    "ngi": {"network": "small", "crop": 32, "lpips": False, "rays": 1},
    "rrf": {"cells": 16, "rays": 1},
    "cnnr": {"network": "small", "crop": 32, "observed": 4, "rays": 1},
}
PACKAGES = {
    "ngi": "neural_global_illumination",
    "rrf": "radiance_regression",
    "cnnr": "compositional_scene_representations",
}


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> Path:
    """A dataset of four views of a room, each under a light of its own."""
    root = tmp_path_factory.mktemp("moving-light") / "room"
    recipe = {"rooms": 1, "seed": 4, "kinds": ["bathroom"], "views": 4, "resolution": list(RESOLUTION)}
    recipe |= {"spp": 4, "lighting": "area-light", "splits": {"test": 1.0}}
    recipe["channels"] = ["radiance", "surface", "reflection", "lighting"]
    make(root, check_recipe(recipe))
    return root


@pytest.fixture(scope="module")
def rig(room):
    return LightRig(load_scene(open_dataset(room).room_folder(0) / "scene.xml"), panoramas=False)


def prepared(name, room, rig, folder):
    """A method that has made STEPS steps, and the folders of what it made."""
    method = installed().get(name).method
    settings, views = method.settings(SETTINGS[name]), training_set(room)
    bakes = BakeCache(folder / "bakes", "scene", {}, views)
    at = dataclasses.replace(site(rig.scene, folder), training=views, rig=rig, bakes=bakes, max_depth=3)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(f"gibench.baselines.{PACKAGES[name]}.training.STEPS", STEPS)
        if method.trains:
            weights = folder / "weights"
            weights.mkdir()
            method.load()(settings).train(Training(views, None, 0, weights, folder / "checkpoint", Stages()))
            at = dataclasses.replace(at, weights=weights)
        running = method.load()(settings)
        running.prepare(at)
    return running, at


@pytest.mark.parametrize("name", SETTINGS)
def test_a_network_learns_repeats_and_gives_frames(name, room, rig, tmp_path):
    kept = []
    for folder in (tmp_path / "first", tmp_path / "again"):
        folder.mkdir()
        running, at = prepared(name, room, rig, folder)
        where = at.weights or next(bake.folder for bake in at.bakes.made if bake.kind == "training")
        record = artifacts.record(where)
        assert record["steps"] == STEPS
        assert record["curve"][0]["step"] == 0
        kept.append(artifacts.kept(where))
    assert kept[0][1] == kept[1][1]
    for network, tensors in kept[0][0].items():
        for key, tensor in tensors.items():
            assert torch.equal(tensor, kept[1][0][network][key])

    shot = next(Shot(frame.camera, frame.lighting) for frame in open_dataset(room))
    rig.set(shot.lighting)
    found = running.render(View(shot, None, RESOLUTION, 0, 0), Stages())
    assert np.isfinite(found.color).all()
    assert (found.indirect >= 0).all()
    # Close to the mean light of the room from the start.
    truth = open_dataset(room)[0].read("indirect_diffuse", "indirect_specular")
    mean = sum(np.mean(part) for part in truth.values())
    assert 0.1 * mean < found.indirect.mean() < 10 * mean


def test_observations_are_made_once_and_leave_the_light_as_it_was(room, rig, tmp_path):
    rig.set(Lighting())
    _, at = prepared("cnnr", room, rig, tmp_path)
    assert rig.lighting == Lighting()
    assert [bake.kind for bake in at.bakes.made] == ["observations", "training"]
    light = np.load(at.bakes.made[0].folder / "light.npy")
    assert light.shape == (4, 3, 3, 64, 64)
    assert np.isfinite(light).all()
    assert light.std(axis=0).mean() > 0
    _, again = prepared("cnnr", room, rig, tmp_path)
    assert not again.bakes.made
    assert {bake.kind for bake in again.bakes.used} == {"observations", "training"}
