"""Training on made-up examples: what it reaches, that it repeats itself, and that it survives being killed."""

from __future__ import annotations

import dataclasses
import io

import numpy as np
import pytest
import torch
from rich.console import Console

from gibench.baselines.efficient_light_probes import training
from gibench.baselines.efficient_light_probes.examples import STEP, TURN, Example, cameras_before
from gibench.baselines.efficient_light_probes.network import GUIDES
from gibench.baselines.efficient_light_probes.training import Plan, Training, scale_of
from gibench.baselines.method import MethodError
from gibench.metrics.lpips_weights import weights_state
from gibench.rendering.camera import PinholeCamera

PLAN = Plan(epochs=8, crop=16, fusion="modulation", lpips=False, temporal=True, seed=3)


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


def weights(run):
    return torch.cat([value.flatten() for value in run.best.values()])


def test_it_learns_to_remove_noise():
    run = Training(EXAMPLES, dataclasses.replace(PLAN, epochs=40))
    before = run.error()
    run.run()
    assert run.best_error < 0.7 * before
    assert 0 < run.best_epoch <= 40


def test_equal_seeds_give_equal_weights_and_others_others():
    first, second, other = (Training(EXAMPLES, dataclasses.replace(PLAN, seed=seed)) for seed in (3, 3, 4))
    for run in (first, second, other):
        run.run()
    assert torch.equal(weights(first), weights(second))
    assert not torch.equal(weights(first), weights(other))


def test_the_seeds_of_others_are_left_alone():
    torch.manual_seed(11)
    expected = torch.rand(1)
    torch.manual_seed(11)
    Training(EXAMPLES, PLAN).run()
    assert torch.rand(1) == expected
    assert not torch.are_deterministic_algorithms_enabled()


def test_killed_half_way_it_ends_with_the_same_weights(tmp_path, monkeypatch):
    whole = Training(EXAMPLES, PLAN)
    whole.run(tmp_path / "whole")

    killed = Training(EXAMPLES, PLAN)
    real = killed._pass

    def dies():
        if killed.epoch == 5:
            raise KeyboardInterrupt
        return real()

    monkeypatch.setattr(killed, "_pass", dies)
    with pytest.raises(KeyboardInterrupt):
        killed.run(tmp_path / "checkpoint")
    resumed = Training(EXAMPLES, PLAN)
    assert resumed.resume(tmp_path / "checkpoint") > 0
    assert resumed.epoch == 5
    resumed.run(tmp_path / "checkpoint")
    assert torch.equal(weights(resumed), weights(whole))
    assert resumed.best_epoch == whole.best_epoch


def test_without_a_checkpoint_it_begins_at_the_beginning(tmp_path):
    assert Training(EXAMPLES, PLAN).resume(tmp_path / "none") == 0


def test_a_damaged_checkpoint_is_named(tmp_path):
    (tmp_path / "checkpoint").write_bytes(b"no weights")
    with pytest.raises(MethodError, match=r"checkpoint.*remove it"):
        Training(EXAMPLES, PLAN).resume(tmp_path / "checkpoint")


def test_it_stops_where_the_held_out_view_gets_no_better():
    """What is held out is given without noise: the network that hands it through is the best there is."""
    clean = example(9, noise=0.0)
    run = Training([*EXAMPLES, clean], dataclasses.replace(PLAN, epochs=40))
    run.run()
    assert run.best_epoch == 0
    assert run.best_error == 0
    assert run.epoch == 21  # half of the epochs, and the one that is too many


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
        run = Training(views, dataclasses.replace(PLAN, epochs=3, lpips=lpips))
        run.run()
        assert np.isfinite(run.best_error)
        assert all(torch.isfinite(value).all() for value in run.network.state_dict().values())


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
    runs = [Training(views, PLAN) for views in (EXAMPLES, large)]
    for run in runs:
        run.run()
    assert runs[1].scale.exposure == pytest.approx(runs[0].scale.exposure / 100)
    assert runs[1].best_error == pytest.approx(runs[0].best_error, rel=1e-2)


def test_crops_larger_than_the_image_and_images_without_hits(tmp_path):
    nothing = dataclasses.replace(EXAMPLES[0], guides=torch.zeros(GUIDES, 24, 32))
    run = Training([nothing, nothing], dataclasses.replace(PLAN, crop=512, epochs=2))
    run.run()
    assert scale_of([nothing]).depth == 1
    assert np.isfinite(run.best_error)


def test_a_terminal_gets_a_bar_and_a_file_gets_lines(monkeypatch):
    for terminal in (True, False):
        out = io.StringIO()
        monkeypatch.setattr(
            training,
            "Console",
            lambda *, stderr, to=out, is_it=terminal: Console(file=to, force_terminal=is_it, width=80),
        )
        Training(EXAMPLES, dataclasses.replace(PLAN, epochs=2)).run()
        assert "epoch 2/2" in out.getvalue()
        assert max(map(len, out.getvalue().splitlines()[-1:])) <= 80 or terminal


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
