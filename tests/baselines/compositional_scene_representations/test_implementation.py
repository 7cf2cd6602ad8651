"""Frames of `cnnr`: three observations of the light that a frame has, and what the networks make of them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from gibench.baselines.compositional_scene_representations import METHOD
from gibench.baselines.compositional_scene_representations.implementation import RepresentedLight
from gibench.baselines.compositional_scene_representations.network import (
    OBSERVATIONS,
    SIDE,
    SMALL,
    Represented,
)
from gibench.baselines.compositional_scene_representations.observations import observers, pose
from gibench.baselines.method import MethodError
from gibench.baselines.moving_light.measure import Measure
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import Lighting
from gibench.rendering.render import render_frame
from tests.baselines.area_lights import HARD_LIGHTS, LIGHT, lit_frame
from tests.baselines.material_strips import CAMERA, strips_rig
from tests.baselines.sites import site

RESOLUTION = (32, 24)
MEASURE = Measure((0.0, 0.0, 1.0), (2.0, 2.0, 1.0), 0.1, 0.05)
CAMERAS = [dataclasses.replace(CAMERA, position=(0.5 * k, -2.4, 1.2)) for k in range(OBSERVATIONS)]


@pytest.fixture(scope="module")
def rig():
    return strips_rig()


def untrained(rig, folder):
    """The method with networks that have learned nothing."""
    running = RepresentedLight(METHOD.settings({"network": "small", "rays": 1, "observed": 4}))
    running.observe(dataclasses.replace(site(rig.scene, folder), rig=rig), CAMERAS, MEASURE)
    torch.manual_seed(0)
    poses = torch.stack([pose(camera, MEASURE) for camera in CAMERAS])
    network = Represented(SMALL, running.observed.fixed(MEASURE).cpu(), poses)
    network.generator.begin_at(torch.full((3,), 0.5))
    running.use(network)
    return running


@pytest.fixture(scope="module")
def method(rig, tmp_path_factory):
    return untrained(rig, tmp_path_factory.mktemp("cnnr"))


def frame(rig, method, light, resolution=RESOLUTION, camera=CAMERA):
    return lit_frame(rig, method, light, resolution, ("observations", "inference"), camera)


def test_observations_are_the_light_of_the_room(rig, method):
    rig.set(Lighting(area=LIGHT))
    seen = torch.expm1(method.observed.light(LIGHT, MEASURE, 0)) * MEASURE.indirect * LIGHT.area
    assert seen.shape == (OBSERVATIONS, 3, SIDE, SIDE)
    for camera, image in zip(CAMERAS, seen, strict=True):
        truth = render_frame(rig.scene, camera, resolution=(SIDE, SIDE), channels=("color",), spp=16).arrays[
            "color"
        ]
        ours = image.cpu().numpy() * np.array(LIGHT.radiance)[:, None, None]
        np.testing.assert_allclose(ours.mean(axis=(1, 2)), truth.mean(axis=(0, 1)), rtol=0.1)
    # What is wholly fixed is seen alike under every light.
    assert method.observed.fixed(MEASURE).shape == (OBSERVATIONS, 7, SIDE, SIDE)


def test_observers_are_far_apart():
    near = [dataclasses.replace(CAMERA, position=(0.01 * k, -2.4, 1.2)) for k in range(10)]
    far = PinholeCamera((0.0, 2.4, 1.2), (0.0, 0.0, 1.0), 1.0)
    other = PinholeCamera((2.0, 0.0, 0.5), (2.0, 1.0, 2.0), 1.0)
    chosen = observers([*near, far, other], MEASURE)
    assert chosen[0] == near[0]
    assert set(chosen[1:]) == {far, other}
    assert observers(near[:1], MEASURE) == [near[0]] * OBSERVATIONS  # as many as there are


@pytest.mark.parametrize("light", HARD_LIGHTS)
def test_hard_lights_give_finite_light(rig, method, light):
    frame(rig, method, light)


def test_light_is_linear_and_black_light_black(rig, method):
    one = frame(rig, method, LIGHT).indirect
    assert one.any()
    for scale in (2e-5, 2e4):
        scaled = dataclasses.replace(LIGHT, radiance=tuple(scale * c for c in LIGHT.radiance))
        np.testing.assert_allclose(frame(rig, method, scaled).indirect, scale * one, rtol=1e-3)
    assert not frame(rig, method, dataclasses.replace(LIGHT, radiance=(0, 0, 0))).color.any()


def test_a_frame_of_sky_alone_and_one_ten_times_larger(rig, method):
    up = PinholeCamera((0.0, 0.0, 3.0), (0.0, 0.1, 9.0), 1.0)
    assert not frame(rig, method, LIGHT, camera=up).color.any()
    frame(rig, method, LIGHT, resolution=(320, 240))


def test_a_scene_without_training_frames_is_refused(rig, tmp_path):
    with pytest.raises(MethodError, match="run it on the track moving-light"):
        RepresentedLight(METHOD.settings()).prepare(site(rig.scene, tmp_path))
