"""Frames of `ngi`: direct light, and what a network says, whatever lights the room."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from gibench.baselines.method import MethodError
from gibench.baselines.moving_light.measure import Measure
from gibench.baselines.neural_global_illumination import METHOD
from gibench.baselines.neural_global_illumination.implementation import NeuralLight
from gibench.baselines.neural_global_illumination.network import SMALL, NeuralGlobalIllumination
from gibench.baselines.training.artifacts import RECORD, WEIGHTS
from gibench.baselines.training.files import write_tensors
from gibench.rendering.camera import PinholeCamera
from tests.baselines.area_lights import HARD_LIGHTS, LIGHT, lit_frame
from tests.baselines.material_strips import CAMERA, strips_rig
from tests.baselines.sites import site

RESOLUTION = (40, 32)


@pytest.fixture(scope="module")
def rig():
    return strips_rig()


def untrained(folder):
    """The weights of a network that has learned nothing."""
    torch.manual_seed(0)
    network = NeuralGlobalIllumination(SMALL)
    facts = Measure((0.0, 0.0, 1.0), (2.0, 2.0, 1.0), 0.1, 0.05).facts()
    write_tensors(folder / WEIGHTS, {"weights": {"network": network.state_dict()}, "facts": facts})
    (folder / RECORD).write_text("{}")
    return folder


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    return untrained(tmp_path_factory.mktemp("weights"))


def prepared(rig, weights, folder):
    running = NeuralLight(METHOD.settings({"network": "small", "rays": 1}))
    running.prepare(dataclasses.replace(site(rig.scene, folder), weights=weights, rig=rig))
    return running


@pytest.fixture(scope="module")
def method(rig, weights, tmp_path_factory):
    return prepared(rig, weights, tmp_path_factory.mktemp("ngi"))


def frame(rig, method, light, resolution=RESOLUTION, camera=CAMERA):
    return lit_frame(rig, method, light, resolution, ("inference",), camera)


@pytest.mark.parametrize("light", HARD_LIGHTS)
def test_hard_lights_give_finite_light(rig, method, light):
    frame(rig, method, light)


def test_light_is_linear(rig, method):
    """Radiance from 1e-4 to 1e5 of the same light."""
    one = frame(rig, method, LIGHT)
    for scale in (2e-5, 2e4):
        scaled = dataclasses.replace(LIGHT, radiance=tuple(scale * c for c in LIGHT.radiance))
        np.testing.assert_allclose(
            frame(rig, method, scaled).color, scale * one.color, rtol=2e-3, atol=1e-4 * scale
        )


def test_a_frame_of_sky_alone_and_a_larger_one(rig, method):
    up = PinholeCamera((0.0, 0.0, 3.0), (0.0, 0.1, 9.0), 1.0)
    assert not frame(rig, method, LIGHT, camera=up).color.any()
    frame(rig, method, LIGHT, resolution=(120, 96))


def test_networks_that_are_not_there_or_damaged_are_named(rig, weights, tmp_path):
    with pytest.raises(MethodError, match="ngi has not been trained"):
        prepared(rig, None, tmp_path)
    (tmp_path / WEIGHTS).write_bytes(b"nothing")
    with pytest.raises(MethodError, match=r"cannot be read .* remove that folder"):
        prepared(rig, tmp_path, tmp_path)
