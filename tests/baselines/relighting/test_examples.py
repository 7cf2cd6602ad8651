"""Training frames pixel by pixel: what is read of a frame, what is kept, and the light of each."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from gibench.baselines.relighting import examples as module
from gibench.baselines.relighting.examples import Examples, box_of, environment_at, evenly
from gibench.baselines.relighting.surfaces import Box
from gibench.baselines.training.errors import TrainingError
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import AreaLight, EnvironmentMap, Lighting
from gibench.rendering.panoramas import Panorama

BOX = Box((0.0, 0.0, 0.0), (2.0, 2.0, 2.0))

SIDE = 12


def environment(seed, rotation=0.0):
    pixels = np.random.default_rng(seed).uniform(0, 1, (8, 16, 3))
    return EnvironmentMap(Panorama.of(f"map {seed}", pixels), rotation)


class Views:
    """Four frames under two environments."""

    lightings = tuple(Lighting(environment=environment(seed)) for seed in (0, 1, 0, 1))

    def __getitem__(self, number):
        return SimpleNamespace(lighting=self.lightings[number], row={"file": f"frame-{number}"})


class Read:
    """Frames whose left half sees a plane, as `image_to_image.frames.Frames`; counts what is read."""

    reads = 0

    def __init__(self, views, channels, numbers):
        self.numbers = list(numbers)

    def __len__(self):
        return len(self.numbers)

    def __getitem__(self, index):
        type(self).reads += 1
        images = {
            name: torch.zeros(3, SIDE, SIDE)
            for name in (
                "position",
                "normal",
                "albedo",
                "specular_albedo",
                "indirect_diffuse",
                "indirect_specular",
            )
        }
        images["roughness"] = torch.zeros(1, SIDE, SIDE)
        left = (..., slice(0, SIDE // 2))
        images["normal"][2][left] = 1
        images["position"][0][left] = torch.linspace(0.5, 1.5, SIDE)[:, None]
        images["indirect_diffuse"][left] = 0.1 * (1 + self.numbers[index])
        images["indirect_specular"][left] = 0.2
        return images

    def camera(self, index):
        return PinholeCamera((1.0, 1.0, 1.0), (1.0, 1.0, 0.0), 1.0, up=(0, 1, 0))

    def exposure(self, index):
        return 2.0


@pytest.fixture
def made(monkeypatch):
    monkeypatch.setattr(module, "Frames", Read)
    monkeypatch.setattr(Read, "reads", 0)
    asked = []

    def light_of(light):
        asked.append(light.panorama.name)
        return light.panorama.pixels

    return Examples(Views(), [3, 0, 2], BOX, light_of), asked


def test_surfaces_light_and_truth_are_those_of_the_frame(made):
    examples, asked = made
    seen, light = examples[0]  # number 3
    assert seen.points.shape == (SIDE * SIDE // 2, 3)
    torch.testing.assert_close(seen.points[0], torch.tensor([0.25, 0.0, 0.0]))
    torch.testing.assert_close(seen.truth[0].float(), torch.full((3,), 2 * 0.6), rtol=1e-3, atol=0)
    np.testing.assert_allclose(light, 2 * environment(1).panorama.pixels)
    assert (seen.detail > 0).any()  # at the edge of the plane
    assert asked == ["map 1"]


def test_nothing_is_read_or_taken_twice(made):
    examples, asked = made
    for _ in range(2):
        for index in range(len(examples)):
            examples[index]
    assert Read.reads == 3
    assert asked == ["map 1", "map 0"]


def test_all_is_read_before_a_training_begins(made):
    examples, asked = made
    examples.read()
    assert Read.reads == 3
    for index in range(len(examples)):
        examples[index]
    assert Read.reads == 3
    assert asked == ["map 1", "map 0"]


def test_of_what_does_not_fit_no_more_is_read_than_that(made, monkeypatch):
    examples, _ = made
    monkeypatch.setattr(module, "KEPT", 1)
    examples.read()
    assert Read.reads == 1


def test_what_does_not_fit_is_read_again(made, monkeypatch):
    examples, _ = made
    monkeypatch.setattr(module, "KEPT", 5000)
    for _ in range(2):
        for index in range(len(examples)):
            examples[index]
    assert Read.reads > 3
    assert examples._bytes <= 5000


def test_the_box_of_some_frames(made):
    box = box_of(Views(), [0, 1, 2])
    assert box.lowest[0] == pytest.approx(0.5, abs=1e-2)
    assert box.size[0] == pytest.approx(1.0, rel=1e-2)


def test_pixels_are_spread_evenly(made):
    seen = made[0].seen(0)
    assert evenly(seen, 4).tolist() == [0, 18, 36, 54]
    assert len(evenly(seen, 10**6)) == len(seen.points)
    assert len(evenly(seen._replace(points=seen.points[:0]), 4)) == 0


def test_frames_under_other_light_are_named():
    views = Views()
    lamp = AreaLight((0, 0, 1), (0, 0, -1), 0.5, 0.5, (1, 1, 1))
    views.lightings = (Lighting(), Lighting(area=lamp))
    for number in (0, 1):
        with pytest.raises(TrainingError, match=f"frame-{number} is not lit by an environment"):
            environment_at(views, number)
