"""The network learns transport that is known, repeats to the bit, and goes on where it was cut off."""

from __future__ import annotations

import dataclasses

import pytest

from gibench.baselines.neural_free_viewpoint_relighting import METHOD
from gibench.baselines.neural_free_viewpoint_relighting.draws import Important
from gibench.baselines.neural_free_viewpoint_relighting.network import FULL, HashField
from gibench.baselines.neural_free_viewpoint_relighting.training import TrainingPlan, WaveletTransport
from gibench.baselines.training.budget import Budget
from gibench.baselines.training.loop import train
from tests.baselines.neural_free_viewpoint_relighting.made import FACES, Made

SMALL = {"network": "small", "faces": 16, "batch": 64, "learned": 16}


def plan(**settings):
    return dataclasses.replace(TrainingPlan.of(METHOD.settings({**SMALL, **settings}), seed=3), faces=FACES)


def learner_of(examples, apart, made):
    return WaveletTransport(made.network(lambda size: HashField(size, 12)), examples, apart, made)


def learnt(steps, **settings):
    learner = learner_of(Made(), Made(2, first=100), plan(**settings))
    drawn = learner.batches()
    return train(learner, drawn, Budget(steps=steps, look_every=steps), seed=3)


def test_it_learns_the_transport_of_light_that_it_never_saw():
    trained = learnt(80)
    assert trained.best.error < 0.6 * trained.curve[0].error


@pytest.mark.parametrize("variant", [None, *METHOD.variants], ids=lambda variant: variant and variant.name)
def test_variants_are_what_they_say(variant):
    made = plan(**(variant.settings if variant else {}))
    learner = learner_of(Made(1, 20), Made(1, 20), made)
    name = variant.name if variant else ""
    assert isinstance(learner.examples, Important) == (name != "uniform-pixels")
    assert learner.network.first.in_features == 32 + 13 + (0 if name == "no-encoding" else 16)


def test_the_defaults_are_those_of_the_paper():
    made = TrainingPlan.of(METHOD.settings(), seed=0)
    assert (made.size, METHOD.settings()["table"], made.faces) == (FULL, 19, 64)
    assert (made.pixels, made.learned, made.important, made.encoding) == (2048, 300, True, True)
