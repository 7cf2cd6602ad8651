"""Frames of `nfvr`: finite, linear, black where it is dark, whatever lights the scene."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from gibench.baselines.method import MethodError, View
from gibench.baselines.neural_free_viewpoint_relighting import METHOD
from gibench.baselines.neural_free_viewpoint_relighting.implementation import NeuralRelighting
from gibench.baselines.neural_free_viewpoint_relighting.training import Plan
from gibench.baselines.relighting.surfaces import Box
from gibench.baselines.stages import Stages
from gibench.baselines.training.artifacts import RECORD, WEIGHTS
from gibench.baselines.training.files import write_tensors
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import EnvironmentMap, Lighting, Shot
from gibench.rendering.panoramas import HEIGHT, Panorama
from tests.baselines.material_strips import CAMERA, strips_rig
from tests.baselines.sites import site

RESOLUTION = (40, 32)

SMALL = {"network": "small", "faces": 16, "table": 12}


@pytest.fixture(scope="module")
def rig():
    return strips_rig(panoramas=True)


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    """Of a network that has learned nothing."""
    folder = tmp_path_factory.mktemp("weights")
    torch.manual_seed(0)
    network = Plan.of(METHOD.settings(SMALL), 0).network()
    facts = Box((-1.5, -1.5, 0.0), (3.0, 3.0, 2.0)).facts()
    write_tensors(folder / WEIGHTS, {"weights": {"network": network.state_dict()}, "facts": facts})
    (folder / RECORD).write_text("{}")
    return folder


def prepared(rig, weights, folder, **settings):
    running = NeuralRelighting(METHOD.settings({**SMALL, "spp": 4, **settings}))
    parts = ("full", "indirect")
    running.prepare(dataclasses.replace(site(rig.scene, folder), weights=weights, rig=rig, parts=parts))
    return running


@pytest.fixture(scope="module")
def method(rig, weights, tmp_path_factory):
    return prepared(rig, weights, tmp_path_factory.mktemp("nfvr"))


def noise(seed=0):
    return np.random.default_rng(seed).uniform(0, 2, (HEIGHT, 2 * HEIGHT, 3)).astype(np.float32)


def environment(pixels, rotation=0.0):
    return EnvironmentMap(Panorama.of("made", pixels), rotation)


def frame(rig, method, light, resolution=RESOLUTION, camera=CAMERA):
    lighting = Lighting(environment=light)
    rig.set(lighting)
    stages = Stages()
    found = method.render(View(Shot(camera, lighting), None, resolution, 0, 0), stages)
    assert {"ray casting", "g-buffer", "light", "inference", "denoising"} == set(stages.seconds)
    for image in (found.color, found.indirect):
        assert image.shape == (resolution[1], resolution[0], 3)
        assert np.isfinite(image).all()
        assert (image >= 0).all()
    return found


def lamp(radiance, rows=1):
    pixels = np.full((HEIGHT, 2 * HEIGHT, 3), 1e-3, np.float32)
    pixels[20 : 20 + rows, 30 : 30 + rows] = radiance
    return pixels


MAPS = {
    "texel": lamp(1e5),
    "sun": lamp(4e4, 2),
    "white": np.ones((HEIGHT, 2 * HEIGHT, 3)),
    "noise": noise(),
}


@pytest.mark.parametrize("pixels", MAPS.values(), ids=MAPS)
def test_hard_environments_give_finite_light(rig, method, pixels):
    frame(rig, method, environment(pixels))


def test_a_whole_turn_changes_nothing(rig, method):
    one, turned = (frame(rig, method, environment(noise(), turn)).indirect for turn in (0.0, 2 * np.pi))
    np.testing.assert_array_equal(one, turned)


def test_light_is_linear(rig, method, weights, tmp_path):
    """Before it is denoised, radiance of 1e-4 to 1e4 of the same light."""
    plain = prepared(rig, weights, tmp_path, denoise=False)
    one = frame(rig, plain, environment(noise())).indirect
    assert one.any()
    for scale in (2.0**-13, 2.0**13):
        scaled = frame(rig, plain, environment(scale * noise())).indirect
        np.testing.assert_allclose(scaled, scale * one, rtol=1e-5, atol=1e-7 * scale)


def test_a_black_environment_gives_black(rig, method):
    images = method._surfaces.read(CAMERA, RESOLUTION)
    told = method.told(np.zeros((6, 16, 16, 3)))
    found = method.indirect(images, View(Shot(CAMERA), None, RESOLUTION, 0, 0), told)
    assert found.shape == (32, 40, 3)
    assert not found.any()


def test_pixels_that_see_no_surface_have_no_indirect_light(rig, method):
    up = PinholeCamera((0.0, 0.0, 3.0), (0.0, 0.1, 9.0), 1.0)
    found = frame(rig, method, environment(noise()), camera=up)
    assert not found.indirect.any()
    assert found.color.any()
    seen = method._surfaces.read(CAMERA, RESOLUTION)["normal"].abs().sum(dim=0).numpy() > 0
    images = method._surfaces.read(CAMERA, RESOLUTION)
    told = method.told(method.light_of(environment(noise())))
    made = method.indirect(images, View(Shot(CAMERA), None, RESOLUTION, 0, 0), told).numpy()
    assert 0.1 < seen.mean() < 1
    assert not made[~seen].any()


def test_fewer_and_more_wavelets_need_no_training(rig, weights, tmp_path):
    method = prepared(rig, weights, tmp_path, denoise=False)
    images = []
    for settings in ({"wavelets": 16}, {"wavelets": 256}, {"selection": "none"}):
        method.adjust(METHOD.settings({**SMALL, "spp": 4, "denoise": False, **settings}))
        images.append(frame(rig, method, environment(noise())).indirect)
    assert (images[0] != images[1]).any()
    assert (images[1] != images[2]).any()


def test_a_frame_of_another_size(rig, method):
    frame(rig, method, environment(noise()), resolution=(120, 96))


def test_networks_that_are_not_there_or_damaged_and_other_light_are_named(rig, method, weights, tmp_path):
    with pytest.raises(MethodError, match="nfvr has not been trained"):
        prepared(rig, None, tmp_path)
    (tmp_path / WEIGHTS).write_bytes(b"nothing")
    with pytest.raises(MethodError, match=r"cannot be read .* remove that folder"):
        prepared(rig, tmp_path, tmp_path)
    with pytest.raises(MethodError, match="run it on the track relight"):
        method.render(View(Shot(CAMERA), None, RESOLUTION, 0, 0), Stages())
