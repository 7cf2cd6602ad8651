"""Training on made-up examples: what it reaches, that it repeats itself, and that it survives being killed."""

from __future__ import annotations

import dataclasses
from itertools import islice

import numpy as np
import pytest
import torch

from gibench.baselines.efficient_light_probes.examples import STEP, TURN, Example, cameras_before
from gibench.baselines.efficient_light_probes.network import GUIDES
from gibench.baselines.efficient_light_probes.training import Reconstructing, TrainingPlan, scale_of
from gibench.baselines.training.checkpoints import Checkpoint
from gibench.baselines.training.errors import CheckpointError
from gibench.metrics.lpips_weights import weights_state
from gibench.rendering.camera import PinholeCamera

PLAN = TrainingPlan(epochs=8, crop=16, fusion="modulation", lpips=False, temporal=True, seed=3)


def example(seed, size=(24, 32), bright=0.0, noise=0.2):
    """An image that is its albedo times a light; the input has noise on it."""
    generator = torch.Generator().manual_seed(seed)
    low = torch.rand(1, 3, 4, 4, generator=generator)
    albedo = torch.nn.functional.interpolate(low, size, mode="bilinear")[0]
    guides = torch.zeros(GUIDES, *size)
    guides[0], guides[3], guides[4:7] = 3.0, 1.0, albedo
    truth = 0.5 * albedo
    if bright:
        truth[:, 5, 7] = bright
    color, before = (
        truth * (1 + noise * torch.randn(truth.shape, generator=generator)).clamp(min=0) for _ in "ab"
    )
    motion, valid = torch.zeros(2, *size), torch.ones(1, *size)
    return Example(color, guides, truth, before, guides, motion, valid)


EXAMPLES = [example(seed) for seed in range(6)]


def learned(examples=EXAMPLES, checkpoint=None, **plan):
    learner = Reconstructing(examples, dataclasses.replace(PLAN, **plan))
    return learner, learner.trained(checkpoint)


def weights(trained):
    return torch.cat([value.flatten() for value in trained.weights["network"].values()])


def test_it_learns_to_remove_noise():
    learner, trained = learned(epochs=40)
    assert trained.best.error < 0.7 * trained.curve[0].error
    assert 0 < trained.best.step <= 40 * learner.steps_of_epoch
    assert learner.steps_of_epoch == 3


def test_equal_seeds_give_equal_weights_and_others_others():
    first, second, other = (learned(seed=seed)[1] for seed in (3, 3, 4))
    assert torch.equal(weights(first), weights(second))
    assert not torch.equal(weights(first), weights(other))


@pytest.mark.parametrize("number", [1, 10, 15])
def test_killed_within_an_epoch_it_ends_with_the_same_weights(tmp_path, number):
    _, whole = learned()
    killed = Reconstructing(EXAMPLES, PLAN)
    real = killed.step

    def dies(batch, now):
        if now.number == number:
            raise KeyboardInterrupt
        return real(batch, now)

    killed.step = dies
    checkpoint = Checkpoint(tmp_path / "checkpoint", {"method": "elp"}, every=0)
    with pytest.raises(KeyboardInterrupt):
        killed.trained(checkpoint)
    _, resumed = learned(checkpoint=checkpoint)
    assert 0 < resumed.before < resumed.seconds
    assert torch.equal(weights(resumed), weights(whole))
    assert resumed.best.step == whole.best.step


@pytest.mark.parametrize("lpips", [False, True])
def test_batches_can_begin_within_an_epoch(monkeypatch, lpips):
    """The window of the perceptual loss comes from the same random numbers, where there is that loss."""
    monkeypatch.setattr("gibench.baselines.efficient_light_probes.training.build_network", torch.nn.ReLU)
    learner = Reconstructing(EXAMPLES, dataclasses.replace(PLAN, lpips=lpips))
    whole = list(islice(learner.batches(0), 12))
    for first in range(1, 9):
        for found, expected in zip(islice(learner.batches(first), 4), whole[first:], strict=False):
            assert [id(one) for one in found.examples] == [id(one) for one in expected.examples]
            assert (found.windows, found.perceptual) == (expected.windows, expected.perceptual)
    assert [one.perceptual is not None for one in whole] == [lpips and step % 4 == 0 for step in range(12)]


def test_a_damaged_checkpoint_is_named(tmp_path):
    (tmp_path / "checkpoint").write_bytes(b"no weights")
    with pytest.raises(CheckpointError, match=r"checkpoint.*remove it"):
        learned(checkpoint=Checkpoint(tmp_path / "checkpoint", {"method": "elp"}))


def test_it_stops_where_the_held_out_view_gets_no_better():
    """What is held out is given without noise: the network that hands it through is the best there is."""
    clean = example(9, noise=0.0)
    learner, trained = learned([*EXAMPLES, clean], epochs=40)
    assert trained.ended == "patience"
    assert (trained.best.step, trained.best.error) == (0, 0)
    assert trained.steps == 21 * learner.steps_of_epoch  # half of the epochs, and the one that is too many


def test_seconds_end_it_with_the_best_so_far():
    trained = Reconstructing(EXAMPLES, dataclasses.replace(PLAN, epochs=1000)).trained(seconds=0.05)
    assert trained.ended == "seconds"
    assert trained.steps < 1000
    assert trained.best.error == min(look.error for look in trained.curve)


@pytest.mark.parametrize(
    ("epochs", "every", "last"), [(40, 1, 21), (50, 1, 26), (100, 2, 50), (1000, 20, 500)]
)
def test_looks_and_patience_are_whole_epochs(epochs, every, last):
    budget = Reconstructing(EXAMPLES, dataclasses.replace(PLAN, epochs=epochs)).budget
    assert (budget.steps, budget.look_every, budget.patience) == (3 * epochs, 3 * every, 3 * last)


@pytest.mark.parametrize(
    "lpips",
    [
        False,
        pytest.param(
            True,
            marks=pytest.mark.skipif(
                weights_state().state != "cached", reason="the weights of LPIPS are not here"
            ),
        ),
    ],
)
def test_very_bright_highlights_and_black_images_train(lpips):
    bright = [example(seed, bright=1e6) for seed in range(3)]
    black = [dataclasses.replace(one, color=0 * one.color, truth=0 * one.truth) for one in bright]
    for views in (bright, black, [bright[0], black[0]]):
        learner, trained = learned(views, epochs=3, lpips=lpips)
        assert np.isfinite(trained.best.error)
        assert all(torch.isfinite(value).all() for value in learner.network.state_dict().values())


def test_a_brighter_scene_of_another_size_trains_alike():
    """Radiance and metres are measured in units of the scene."""
    large = [
        dataclasses.replace(
            one,
            **{name: 100 * getattr(one, name) for name in ("color", "truth", "before")},
            **{
                name: torch.cat([100 * getattr(one, name)[:1], getattr(one, name)[1:]])
                for name in ("guides", "guides_before")
            },
        )
        for one in EXAMPLES
    ]
    (first, trained), (second, again) = (learned(views) for views in (EXAMPLES, large))
    assert second.scale.exposure == pytest.approx(first.scale.exposure / 100)
    assert again.best.error == pytest.approx(trained.best.error, rel=1e-2)


def test_crops_larger_than_the_image_and_images_without_hits():
    nothing = dataclasses.replace(EXAMPLES[0], guides=torch.zeros(GUIDES, 24, 32))
    _, trained = learned([nothing, nothing], crop=512, epochs=2)
    assert scale_of([nothing]).depth == 1
    assert np.isfinite(trained.best.error)


def test_earlier_cameras_lie_on_a_line_and_turn_steadily():
    camera = PinholeCamera((1, 2, 1.5), (3, 2, 1.2), 1.1)
    rng = np.random.default_rng(0)
    for _ in range(20):
        found = [camera, *cameras_before(camera, 4.0, 3, rng)]
        ways = np.diff([one.position for one in found], axis=0)
        np.testing.assert_allclose(ways, np.tile(ways[0], (3, 1)), atol=1e-9)
        assert 4 * STEP[0] <= np.linalg.norm(ways[0]) <= 4 * STEP[1]
        assert ways[0][2] == 0
        views = [np.subtract(one.target, one.position) for one in found]
        yaws = np.unwrap([np.arctan2(v[1], v[0]) for v in views])
        np.testing.assert_allclose(np.diff(yaws), np.diff(yaws)[0], atol=1e-9)
        assert abs(yaws[1] - yaws[0]) <= 2 * TURN + 1e-9
        np.testing.assert_allclose([v[2] for v in views], views[0][2])
        assert len({one.fov for one in found}) == 1


def test_it_trains_on_the_device_of_the_variant(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    assert Reconstructing(EXAMPLES, PLAN).device.type == "cpu"
