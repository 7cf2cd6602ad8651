"""A method whose process is killed in the middle of its first training."""

from __future__ import annotations

import os
import signal
import time

from gibench.baselines.method import Method, Prediction
from gibench.baselines.training import artifacts
from gibench.baselines.training.budget import Budget
from gibench.baselines.training.checkpoints import Checkpoint
from gibench.baselines.training.loop import train
from gibench.benchmarks.registry import Found
from tests.baselines.training.toys import Fit, points
from tests.benchmarks.toys import image

STEPS, KILLED_AT, PAUSE = 12, 8, 0.05


class Mortal:
    """Learns a curve and paints its error."""

    def __init__(self, settings):
        self.settings = dict(settings)

    def train(self, training):
        first = not training.checkpoint.exists()
        learner = Fit()
        real = learner.step

        def step(batch, now):
            time.sleep(PAUSE)
            if first and now.number == KILLED_AT:
                os.kill(os.getpid(), signal.SIGKILL)
            return real(batch, now)

        learner.step = step
        checkpoint = Checkpoint(training.checkpoint, {"method": "mortal"}, every=0)
        trained = train(learner, points(), Budget(steps=STEPS, look_every=4), seed=3, checkpoint=checkpoint)
        artifacts.keep(training.folder, trained, steps_before=0 if first else KILLED_AT)
        return trained.before

    def prepare(self, site):
        self.weights, self.facts = artifacts.kept(site.weights)

    def render(self, view, stages):
        return Prediction(image(view, float(self.weights["fit"]["3.bias"].abs())))


MORTAL = Found(
    Method(
        id="mortal",
        title="A toy that dies",
        family="toys",
        tracks=("walkthrough",),
        paper="none",
        implementation="tests.benchmarks.mortal:Mortal",
        channels=("color",),
        trains=True,
    ),
    "toys",
    "1.0",
)
