"""The method `elp` as a whole: trained for a small room, rendered along a path, found again."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from gibench.baselines.efficient_light_probes import METHOD, SEARCH, training
from gibench.baselines.method import MethodError, View
from gibench.baselines.stages import Stages
from gibench.baselines.training import artifacts, checkpoints
from gibench.datasets.cameras import columns_of
from gibench.datasets.loading import Frame
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import Shot
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.baselines.efficient_light_probes.test_implementation import mirror_floor
from tests.baselines.sites import RESOLUTION, site
from tests.rendering import scenes

SMALL = {
    "texels": 8,
    "lightmap_spp": 16,
    "lightmap_denoise": False,
    "probes": 8,
    "probe_width": 64,
    "probe_spp": 4,
    "rays": 1,
    "epochs": 20,
    "crop": 32,
    "lpips": False,
}
CAMERAS = [
    PinholeCamera((0.7 * np.cos(a), 0.7 * np.sin(a), 0.2), (-0.3 * np.cos(a), -0.3 * np.sin(a), -0.6), 1.2)
    for a in np.linspace(0.3, 2.5, 6)
]


class Still(Frame):
    """A training view in memory."""

    def __init__(self, view, camera, color):
        record = {"camera": camera.position, "target": camera.target, "fov": camera.fov}
        super().__init__(None, {"room": 0, "view": view, "file": f"{view}", **columns_of(record)})
        self.color = color

    def read(self, *channels):
        return {"color": self.color}


def stills(scene, spp=256):
    return tuple(
        Still(
            k,
            camera,
            render_frame(scene, camera, resolution=RESOLUTION, spp=spp, channels=["color"]).arrays["color"],
        )
        for k, camera in enumerate(CAMERAS)
    )


def made(method, where, **given):
    knobs = {name: value for name, value in (SMALL | given).items() if name in {k.name for k in method.knobs}}
    implementation = method.load()(method.settings(knobs))
    implementation.prepare(where)
    return implementation


def path(count=3):
    """A walk that none of the stills lies on."""
    shots = [
        Shot(PinholeCamera((0.5 - 0.05 * k, 0.55, 0.25), (-0.4 - 0.05 * k, -0.5, -0.7), 1.2))
        for k in range(count)
    ]
    return [View(s, b, RESOLUTION, k, 0) for k, (s, b) in enumerate(zip(shots, [None, *shots], strict=False))]


@pytest.fixture(scope="module")
def where(tmp_path_factory):
    scene = load_dict(mirror_floor(0.2))
    return dataclasses.replace(site(scene, tmp_path_factory.mktemp("elp")), training=stills(scene))


def test_nearer_to_the_truth_than_the_search_alone(where):
    method, search = made(METHOD, where, epochs=100), made(SEARCH, where)
    errors = {"elp": [], "search": []}
    for view in path():
        truth = render_frame(
            where.scene, view.camera, resolution=RESOLUTION, spp=512, channels=["color"]
        ).arrays["color"]
        for name, one in (("elp", method), ("search", search)):
            stages = Stages()
            found = one.render(view, stages)
            errors[name].append(np.mean((np.minimum(found.color, 1) - np.minimum(truth, 1)) ** 2))
    assert np.mean(errors["elp"]) < 0.7 * np.mean(errors["search"])


def test_a_path_forgets_what_was_before_it(where):
    method = made(METHOD, where)
    first = [method.render(view, Stages()).color for view in path()]
    again = [method.render(view, Stages()).color for view in path()]
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(one, other)
    alone = method.render(dataclasses.replace(path()[2], previous=None), Stages()).color
    assert np.abs(alone - first[2]).max() > 1e-3
    assert method.kernels["temporal"].recordings == 1


def test_without_temporal_parts_a_frame_stands_alone(where):
    method = made(METHOD, where, temporal=False)
    walk = path()
    on_path = [method.render(view, Stages()).color for view in walk][2]
    alone = method.render(dataclasses.replace(walk[2], previous=None), Stages()).color
    np.testing.assert_array_equal(on_path, alone)


def test_the_network_is_trained_once_and_every_setting_that_does_not_bake_has_it(where, monkeypatch):
    first = made(METHOD, where)
    expected = first.render(path()[0], Stages()).color
    monkeypatch.setattr(training.Reconstructing, "step", lambda *_: pytest.fail("it was trained again"))
    second = made(METHOD, where, rays=4, steps=5)
    second.adjust(first.settings)
    np.testing.assert_array_equal(second.render(path()[0], Stages()).color, expected)
    assert not list(where.bakes.root.glob(".training*"))
    bake = next(bake for bake in where.bakes.used if bake.kind == "training")
    assert bake.seconds > 0
    told = artifacts.record(bake.folder)
    assert told["best"]["step"] in [look["step"] for look in told["curve"]]
    assert 0 < told["steps"] <= told["plans"][-1]["steps"]


def test_killed_while_it_trains_it_goes_on_and_is_charged_for_all_of_it(where, monkeypatch):
    real = training.Reconstructing.step
    monkeypatch.setattr(checkpoints, "EVERY_SECONDS", 0.0)

    def dies(learner, batch, now):
        if now.number == 10:
            raise KeyboardInterrupt
        return real(learner, batch, now)

    monkeypatch.setattr(training.Reconstructing, "step", dies)
    with pytest.raises(KeyboardInterrupt):
        made(METHOD, where, fusion="concatenation")
    checkpoint = next(where.bakes.root.glob(".training*.checkpoint"))
    spent = torch.load(checkpoint)["state"]["seconds"]
    numbers = []
    monkeypatch.setattr(
        training.Reconstructing,
        "step",
        lambda learner, batch, now: numbers.append(now.number) or real(learner, batch, now),
    )
    made(METHOD, where, fusion="concatenation")
    assert numbers[0] == 10
    assert not checkpoint.exists()
    assert next(b for b in where.bakes.used[::-1] if b.kind == "training").seconds > spent > 0


def test_what_a_frame_tells(where):
    stages = Stages()
    found = made(METHOD, where).render(path()[0], stages)
    assert set(stages.seconds) == {"g-buffer", "ray casting", "search", "temporal", "inference"}
    assert found.specular is None
    assert found.color.dtype == np.float32
    assert np.isfinite(found.color).all()
    assert (found.color >= 0).all()
    assert found.extra["parameters"] == 121435
    assert 0 <= found.extra["best_epoch"] <= SMALL["epochs"]


def test_one_training_view_is_not_enough(where, tmp_path):
    lonely = dataclasses.replace(where, training=where.training[:1])
    with pytest.raises(MethodError, match="has 1: ask for more `views`"):
        made(METHOD, lonely, epochs=2)


def test_without_gloss_it_is_still_a_method(tmp_path):
    scene = load_dict(scenes.closed_box(0.5, 1.0))
    box = dataclasses.replace(site(scene, tmp_path), training=stills(scene, spp=64)[:3])
    found = made(METHOD, box, epochs=2).render(path()[0], Stages())
    assert found.extra["search_steps"] == 0
    assert np.isfinite(found.color).all()
    assert (found.color > 0).all()
