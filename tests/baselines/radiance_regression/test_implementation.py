"""Frames of `rrf`: direct light, and what the networks of the parts say, whatever lights the room."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from gibench.baselines.method import MethodError
from gibench.baselines.moving_light.measure import Measure
from gibench.baselines.radiance_regression import METHOD
from gibench.baselines.radiance_regression.implementation import RegressedLight
from gibench.baselines.radiance_regression.network import CellNetworks
from gibench.baselines.radiance_regression.partition import partitioned
from gibench.baselines.training.artifacts import RECORD, WEIGHTS
from gibench.baselines.training.files import write_tensors
from gibench.rendering.camera import PinholeCamera
from tests.baselines.area_lights import HARD_LIGHTS, LIGHT, lit_frame
from tests.baselines.material_strips import CAMERA, strips_rig
from tests.baselines.sites import site

RESOLUTION = (32, 24)


@pytest.fixture(scope="module")
def rig():
    return strips_rig()


def untrained(folder):
    """The weights of networks that have learned nothing, over half of the room."""
    torch.manual_seed(0)
    place = torch.rand(2000, 3) * torch.tensor([1.5, 3.0, 2.0]) - torch.tensor([1.5, 1.5, 0.0])
    partition = partitioned(place, place, 8)
    networks = CellNetworks(8)
    networks.begin_at(torch.full((8, 3), -0.8))
    facts = Measure((0.0, 0.0, 1.0), (2.0, 2.0, 1.0), 0.1, 0.05).facts()
    content = {"cells": networks.state_dict(), "partition": partition.tensors()}
    write_tensors(folder / WEIGHTS, {"weights": content, "facts": facts})
    (folder / RECORD).write_text("{}")
    return folder


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    return untrained(tmp_path_factory.mktemp("weights"))


def prepared(rig, weights, folder):
    running = RegressedLight(METHOD.settings({"rays": 1}))
    running.prepare(dataclasses.replace(site(rig.scene, folder), weights=weights, rig=rig))
    return running


@pytest.fixture(scope="module")
def method(rig, weights, tmp_path_factory):
    return prepared(rig, weights, tmp_path_factory.mktemp("rrf"))


def frame(rig, method, light, resolution=RESOLUTION, camera=CAMERA):
    return lit_frame(rig, method, light, resolution, ("inference",), camera)


@pytest.mark.parametrize("light", HARD_LIGHTS)
def test_hard_lights_give_finite_light(rig, method, light):
    assert frame(rig, method, light).indirect.any()


def test_light_is_linear_and_black_light_black(rig, method):
    one = frame(rig, method, LIGHT).indirect
    for scale in (2e-5, 2e4):
        scaled = dataclasses.replace(LIGHT, radiance=tuple(scale * c for c in LIGHT.radiance))
        np.testing.assert_allclose(frame(rig, method, scaled).indirect, scale * one, rtol=1e-5)
    assert not frame(rig, method, dataclasses.replace(LIGHT, radiance=(0, 0, 0))).color.any()


def test_a_frame_of_sky_alone_and_one_ten_times_larger(rig, method, monkeypatch):
    monkeypatch.setattr("gibench.baselines.radiance_regression.implementation.AT_ONCE", 10_000)
    up = PinholeCamera((0.0, 0.0, 3.0), (0.0, 0.1, 9.0), 1.0)
    assert not frame(rig, method, LIGHT, camera=up).color.any()
    small, large = (frame(rig, method, LIGHT, resolution=(n * 32, n * 24)).indirect for n in (1, 10))
    np.testing.assert_allclose(large.mean(), small.mean(), rtol=0.05)


def test_networks_that_are_not_there_or_damaged_are_named(rig, weights, tmp_path):
    with pytest.raises(MethodError, match="rrf has not been trained"):
        prepared(rig, None, tmp_path)
    (tmp_path / WEIGHTS).write_bytes(b"nothing")
    with pytest.raises(MethodError, match=r"cannot be read .* remove that folder"):
        prepared(rig, tmp_path, tmp_path)
