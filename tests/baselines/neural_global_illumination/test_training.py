"""The network learns, goes on where it was cut off, and gives frames of any size."""

from __future__ import annotations

import pytest
import torch

from gibench.baselines.moving_light.measure import CODE
from gibench.baselines.neural_global_illumination import METHOD
from gibench.baselines.neural_global_illumination.network import SMALL, NeuralGlobalIllumination
from gibench.baselines.neural_global_illumination.training import Example, Predicting, TrainingPlan, size_of
from gibench.baselines.training.batches import batches
from gibench.baselines.training.budget import Budget
from gibench.baselines.training.learner import Step
from gibench.baselines.training.loop import train
from gibench.baselines.training.reproducible import random_of_step


class Made:
    """Frames whose indirect light is what the network is given as direct light, by half."""

    def __init__(self, count=4, side=32):
        self.examples = []
        for seed in range(count):
            generator = torch.Generator().manual_seed(seed)
            inputs = torch.rand(34, side, side, generator=generator)
            code = 0.5 * inputs[16:19] - 0.9
            self.examples.append(
                Example(inputs, code, torch.zeros(3, side, side), torch.full((3, 1, 1), 0.1))
            )

    def __len__(self):
        return len(self.examples)

    def __getitem__(self, index):
        return self.examples[index]


def plan(**settings):
    return TrainingPlan.of(METHOD.settings({"network": "small", "crop": 32, **settings}), seed=3, seconds=1.0)


def learner(**settings):
    made = Made()
    return Predicting(made, made.examples[:1], plan(**settings))


def learnt(steps=12, **settings):
    one = learner(**settings)
    crops = batches(one.examples, 2, one.plan.seed, draw=one._crop)
    return train(one, crops, Budget(steps=steps, look_every=steps), seed=3)


def test_it_learns_and_repeats_to_the_bit():
    first, again = learnt(lpips=False), learnt(lpips=False)
    assert first.best.error < 0.9 * first.curve[0].error  # it begins at the mean
    for name, tensor in first.weights["network"].items():
        assert torch.equal(tensor, again.weights["network"][name])


def test_it_begins_smooth_at_the_mean_light():
    one = learner(lpips=False)
    example = one.held_out[0]
    with torch.no_grad():
        code = one.network(example.inputs[None])[0]
    mean = example.code.mean(dim=(1, 2))
    assert (code - mean[:, None, None]).abs().mean() < 0.3
    one.network.begin_at(torch.tensor([0.1, 0.2, 0.3]))
    torch.testing.assert_close(one.network.last.bias.detach(), torch.tensor([0.1, 0.2, 0.3]))


def test_the_perceptual_loss_comes_at_the_end():
    one = learner()
    assert one.lpips is not None
    code = one.held_out[0].code[None]
    looks = [one._looks(Step(n, n / 40, random_of_step(0, n)), code) for n in range(40)]
    assert [n for n, look in enumerate(looks) if look] == [32, 36]
    batch = Example(*(part[None] for part in one.held_out[0]))
    before = one.weights()["network"]["last.weight"].clone()
    losses = one.step(batch, Step(32, 0.8, random_of_step(0, 32)))
    assert set(losses) == {"pixels", "lpips"}
    assert all(torch.isfinite(loss) for loss in losses.values())
    assert (one.weights()["network"]["last.weight"] != before).any()


@pytest.mark.parametrize("variant", METHOD.variants, ids=lambda variant: variant.name)
def test_every_variant_is_another_network_or_another_training(variant):
    settings = METHOD.settings({"network": "small", **variant.settings})
    size = size_of(settings)
    assert (size == SMALL) == (variant.name in ("no-lpips", "no-cues", "position-only", "facing"))
    with torch.no_grad():
        code = NeuralGlobalIllumination(size)(torch.rand(1, 34, 32, 48))
    assert code.shape == (1, 3, 32, 48)


@pytest.mark.parametrize("name", ["small", "full"])
def test_a_step_learns_from_crops_that_the_network_need_not_pad(name):
    settings = METHOD.settings({"network": name})
    size = size_of(settings)
    crop = TrainingPlan.of(settings, seed=3, seconds=1.0).crop
    assert crop % 2 ** len(size.levels) == 0
    assert crop == {"small": 64, "full": 256}[name]
    assert TrainingPlan.of({**settings, "crop": 32}, seed=3, seconds=1.0).crop == 32


def test_a_frame_ten_times_larger_and_one_of_nothing():
    network = NeuralGlobalIllumination(SMALL).eval()
    with torch.inference_mode():
        for inputs in (torch.rand(1, 34, 320, 320), torch.zeros(1, 34, 33, 17)):
            light = CODE.decode(network(inputs))
            assert light.isfinite().all()
            assert (light >= 0).all()
            assert light.shape[-2:] == inputs.shape[-2:]
