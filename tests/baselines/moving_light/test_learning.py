"""From files to frames: the networks of the track learn from a dataset, repeat, and are found again."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import torch

from gibench.baselines.bakes import BakeCache
from gibench.baselines.image_to_image import implementation
from gibench.baselines.image_to_image.examples import READ, Draw, Examples, inputs_of
from gibench.baselines.image_to_image.frames import Frames
from gibench.baselines.image_to_image.learner import IndirectLight, TrainingPlan
from gibench.baselines.image_to_image.shading import brightness, in_units, indirect
from gibench.baselines.image_to_image.units import Units
from gibench.baselines.method import Training, View
from gibench.baselines.stages import Stages
from gibench.baselines.training import artifacts
from gibench.baselines.training.learner import Step
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
    "ngi:facing": {"network": "small", "crop": 32, "lpips": False, "rays": 1, "lighting": "facing"},
    "rrf": {"cells": 16, "rays": 1},
    "rrf:facing": {"cells": 16, "rays": 1, "facing": True},
    "cnnr": {"network": "small", "crop": 32, "observed": 4, "rays": 1},
    "bcn": {"width": 0.125, "crop": 32, "batch": 4, "perceptual": False, "denoise": False, "spp": 4},
}
LENGTHS = {
    "ngi": "neural_global_illumination.training.STEPS",
    "rrf": "radiance_regression.training.STEPS",
    "cnnr": "compositional_scene_representations.training.STEPS",
    "bcn": "image_to_image.implementation.EPOCHS",
}
"""What says how long a training is; an epoch of `bcn` is one step here."""


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
        patch.setattr(f"gibench.baselines.{LENGTHS[name.partition(':')[0]]}", STEPS)
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


def test_light_of_image_networks_is_in_units_of_what_the_light_gives_off(room):
    frames = Frames(training_set(room), READ)
    units = Units.of_frames(frames)
    assert not units.own
    examples = Examples(frames, units)
    read = [(examples[k], frames.area_light(k)) for k in range(len(examples))]
    for example, area in read:
        given = units.in_view * area.area * torch.tensor(area.radiance)
        torch.testing.assert_close(example.unit.flatten(), given)
    seen = [
        in_units(
            brightness(one.images["direct_diffuse"], one.images["albedo"], of_each_colour=True), one.unit
        ).mean()
        for one, _ in read
    ]
    assert np.mean(seen) == pytest.approx(1, rel=1e-5)
    # How bright the room is is known: exposures are not drawn.
    drawn = Draw(16, 0.0)(examples[0], np.random.default_rng(0))
    assert torch.equal(drawn["unit"], examples[0].unit)
    # Nothing is known of it where a light gives nothing, or nothing of it was ever in view.
    direct, albedo = (read[0][0].images[name] for name in ("direct_diffuse", "albedo"))
    assert torch.equal(Units().of(direct, albedo, read[0][1]), brightness(direct, albedo))
    assert not units.of(direct, albedo, dataclasses.replace(read[0][1], radiance=(0, 0, 0))).any()


@torch.no_grad()
@pytest.mark.parametrize(("tint", "error"), [((1, 0.5, 0.125), 0), ((1, 0.5, 0.1), 1e-4), ((1, 0.5, 0), 0)])
@pytest.mark.parametrize("name", ["bcn", "gfa"])
def test_the_colour_of_the_light_is_that_of_the_prediction(room, name, tint, error):
    frames = Frames(training_set(room), READ)
    units, area = Units.of_frames(frames), frames.area_light(0)
    example = inputs_of(Examples(frames, units)[0])
    torch.manual_seed(0)
    method = installed().get(name).method
    network = method.load()(method.settings({"width": 0.125})).network().eval()

    def made(tint):
        light = torch.tensor(tint)[:, None, None]
        lamp = dataclasses.replace(
            area, radiance=tuple((light.flatten() * torch.tensor(area.radiance)).tolist())
        )
        direct, albedo = example["direct"] * light, example["albedo"]
        unit = units.of(direct, albedo, lamp)
        return indirect(network, *(image[None] for image in (direct, albedo, example["geometry"], unit)))[0]

    white, tinted = made((1, 1, 1)), made(tint)
    held = torch.tensor(tint) > 0
    expected = white * torch.tensor(tint)[:, None, None]
    assert (white > 0).all()
    if held.all():
        torch.testing.assert_close(tinted, expected, rtol=error, atol=0)
    # What is left of a light without blue is lit by nothing blue.
    assert not tinted[~held].any()


def test_a_frame_that_sees_no_direct_light_teaches_an_image_network(room):
    frames = Frames(training_set(room), READ)
    examples = Examples(frames, Units.of_frames(frames))
    torch.manual_seed(0)
    network = (
        installed().get("bcn").method.load()({**installed().get("bcn").method.settings(), "width": 0.125})
    )
    learner = IndirectLight(network.network(), examples, examples, TrainingPlan(24, 1, False, False, 0))
    batch = next(iter(learner.batches()(0)))
    losses = learner.step({**batch, "direct": 0 * batch["direct"]}, Step(0, 0.0, np.random.default_rng(0)))
    assert losses["content"] > 0


def test_a_colour_that_the_light_lacks_teaches_nothing(room):
    frames = Frames(training_set(room), READ)
    examples = Examples(frames, Units.of_frames(frames))
    method = installed().get("bcn").method
    torch.manual_seed(0)
    network = method.load()({**method.settings(), "width": 0.125}).network()
    learner = IndirectLight(network, examples, examples, TrainingPlan(24, 1, False, True, 0))
    batch = next(iter(learner.batches()(0)))
    blue = torch.tensor([0.0, 0, 1])[:, None, None]
    losses = learner.step(
        {**batch, "unit": batch["unit"] * (1 - blue)}, Step(0, 0.9, np.random.default_rng(0))
    )
    assert all(torch.isfinite(loss) for loss in losses.values())
    assert losses["content"] > 0
    assert losses["adversarial"] > 0
    gradient = learner.network.last.weight.grad
    assert gradient[:2].any()
    assert not gradient[2].any()


def test_an_image_network_gives_frames_by_the_unit_that_it_learned_in(room, rig, tmp_path):
    method = installed().get("bcn").method
    settings = method.settings({"width": 0.125, "perceptual": False, "denoise": False, "spp": 4})
    views = training_set(room)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(implementation, "EPOCHS", 1)
        method.load()(settings).train(Training(views, None, 0, tmp_path, tmp_path / "checkpoint", Stages()))
    facts = artifacts.kept(tmp_path)[1]
    running = method.load()(settings)
    running.prepare(dataclasses.replace(site(rig.scene, tmp_path), weights=tmp_path, rig=rig))
    shot = next(Shot(frame.camera, frame.lighting) for frame in open_dataset(room))
    rig.set(shot.lighting)
    found = running.render(View(shot, None, RESOLUTION, 0, 0), Stages())
    assert (found.indirect > 0).any()
    # Light is linear, and known by what the source gives off: twice as much gives twice as much.
    area = dataclasses.replace(shot.lighting.area, radiance=tuple(2 * c for c in shot.lighting.area.radiance))
    rig.set(Lighting(area))
    twice = running.render(View(Shot(shot.camera, Lighting(area)), None, RESOLUTION, 0, 0), Stages())
    np.testing.assert_allclose(twice.indirect, 2 * found.indirect, rtol=1e-4, atol=1e-7)
    tint = np.array([1, 0.5, 0.1])
    tinted_light = dataclasses.replace(shot.lighting.area, radiance=tuple(tint * shot.lighting.area.radiance))
    rig.set(Lighting(tinted_light))
    tinted = running.render(View(Shot(shot.camera, Lighting(tinted_light)), None, RESOLUTION, 0, 0), Stages())
    np.testing.assert_allclose(tinted.indirect, tint * found.indirect, rtol=1e-4, atol=1e-7)
    # A light that nothing in view sees leaves what the unit says, which is not black.
    below = dataclasses.replace(area, centre=(0, 0, -5), direction=(0, 0, -1))
    rig.set(Lighting(below))
    unlit = running.render(View(Shot(shot.camera, Lighting(below)), None, RESOLUTION, 0, 0), Stages())
    assert np.isfinite(unlit.color).all()
    assert unlit.extra["lit"] == 0
    assert facts["in_view"] > 0
    assert (unlit.indirect > 0).any()
