"""The networks learn that brighter observations mean brighter light, and repeat to the bit."""

from __future__ import annotations

import torch

from gibench.baselines.compositional_scene_representations import METHOD
from gibench.baselines.compositional_scene_representations.network import OBSERVATIONS, PIXEL, SIDE
from gibench.baselines.compositional_scene_representations.training import (
    Example,
    Representing,
    TrainingPlan,
    described,
)
from gibench.baselines.moving_light.kept import KeptExamples, widened
from gibench.baselines.training.batches import batches
from gibench.baselines.training.budget import Budget
from gibench.baselines.training.loop import train
from tests.baselines.neural_global_illumination.test_inputs import CAMERA, MEASURE, frame


class Made(KeptExamples[Example]):
    """Frames whose light is that of their observations, times what the surface reflects."""

    def __init__(self, count=6):
        super().__init__(count)
        self.times = 0

    def made(self, index):
        self.times += 1
        generator = torch.Generator().manual_seed(index)
        pixels = torch.rand(PIXEL, 16, 16, generator=generator)
        bright = torch.full((OBSERVATIONS, 3, SIDE, SIDE), 0.5 * index)
        return Example(bright, pixels, 0.4 * index * pixels[9:12])


def learner():
    settings = METHOD.settings({"network": "small", "crop": 32})
    fixed, poses = torch.zeros(OBSERVATIONS, 7, SIDE, SIDE), torch.zeros(OBSERVATIONS, 16)
    made = Made()
    return Representing(made, [made[1], made[4]], fixed, poses, TrainingPlan.of(settings, 3, 1.0))


def learnt(steps):
    one = learner()
    crops = batches(one.examples, 2, 3, draw=one._crop)
    return train(one, crops, Budget(steps=steps, look_every=steps), seed=3)


def test_it_learns_and_repeats_to_the_bit():
    first, again = learnt(30), learnt(30)
    assert first.best.error < 0.8 * first.curve[0].error
    for name, tensor in first.weights["network"].items():
        assert torch.equal(tensor, again.weights["network"][name])


def test_examples_are_put_together_once(monkeypatch):
    made = Made()
    first, again = made[3], made[3]
    assert made.times == 1
    for one, other in zip(first, again, strict=True):
        assert torch.equal(one, other)
    assert first.pixels.dtype == first.truth.dtype == torch.float16
    assert {part.dtype for part in widened(first)} == {torch.float32}
    monkeypatch.setattr("gibench.baselines.moving_light.kept.KEPT", 0)
    made = Made()
    assert all(torch.equal(one, other) for one, other in zip(made[2], made[2], strict=True))
    assert made.times == 2


def test_channels_of_a_pixel_in_closed_form():
    images = frame()
    images["normal"][:, 0, 0] = 0
    found = described(images, CAMERA, MEASURE)
    assert found.shape == (PIXEL, 4, 5)
    assert not found[:, 0, 0].any()
    towards = torch.tensor(CAMERA.position)[:, None, None] - images["position"]
    torch.testing.assert_close(found[6:9, 1:], (towards / towards.norm(dim=0))[:, 1:])
    torch.testing.assert_close(found[:3, 1:], MEASURE.inside(images["position"])[:, 1:])
    assert torch.equal(found[15:, 1:], images["roughness"][:, 1:])
