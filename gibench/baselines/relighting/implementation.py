"""Methods that relight a scene by a network, which says the indirect light of one surface at a time."""

from __future__ import annotations

from abc import abstractmethod
from pathlib import Path
from typing import Any, ClassVar

from torch import Tensor, nn

from gibench.baselines.method import MethodError, Site, Training, reading
from gibench.baselines.relighting.examples import Examples, box_of
from gibench.baselines.relighting.frames import Relit
from gibench.baselines.relighting.held_out import held_out
from gibench.baselines.relighting.learner import RelightingLearner
from gibench.baselines.relighting.surfaces import Box, Pixels
from gibench.baselines.sources import digest
from gibench.baselines.training import artifacts
from gibench.baselines.training.budget import Budget
from gibench.baselines.training.checkpoints import Checkpoint
from gibench.baselines.training.loop import train
from gibench.baselines.training_set import TrainingSet
from gibench.rendering.backend import torch_device

HELD_OUT, JUDGED = 0.05, 24
"""Share of the environments that is held out, and how many frames under them are looked at."""


class RelitByNetwork(Relit):
    """A method with `CHANNELS` as its channels. A subclass has the network."""

    steps: ClassVar[int]
    """Of a training without a limit of seconds."""

    def survey(self, views: TrainingSet, number: int, box: Box, folder: Path) -> None:
        """Make what the network stands on, beside its training, and leave it in a folder: nothing.

        number: of one of the views. box: of the places that they see.
        """

    def surveyed(self, folder: Path, box: Box) -> None:
        """Read that again."""

    @abstractmethod
    def untrained(self, seed: int) -> nn.Module:
        """The network."""

    @abstractmethod
    def learner(self, examples: Examples, apart: Examples, seed: int) -> RelightingLearner:
        """Of that network. apart: what is held out."""

    @abstractmethod
    def radiance(self, points: Tensor, material: Tensor, told: Any) -> Tensor:
        """Indirect radiance (N, 3), signed, of surfaces at points (N, 3) of the unit cube, material (N, 13)."""

    def train(self, training: Training) -> float:
        """Learn the scene. Returns seconds that were spent before."""
        views = training.views
        learned, judged = held_out(views, HELD_OUT, JUDGED)
        box = box_of(views, learned)
        self.survey(views, learned[0], box, training.folder)
        examples, apart = (Examples(views, numbers, box, self.light_of) for numbers in (learned, judged))
        # Some learners look at all frames first, others at none: either way the seconds are of learning alone.
        examples.read()
        learner = self.learner(examples, apart, training.seed)
        names = self.method.trained_settings(self.settings)
        sources = digest(type(self).__module__)
        owner = {"method": self.method.id, "sources": sources, "views": views.sha256, **names}
        trained = train(
            learner,
            learner.batches(),
            Budget(steps=None if training.seconds else self.steps, seconds=training.seconds),
            seed=training.seed,
            checkpoint=Checkpoint(training.checkpoint, owner),
            title=self.method.id,
        )
        artifacts.keep(training.folder, trained, **box.facts())
        return trained.before

    def prepare(self, site: Site) -> None:
        """Read the network."""
        super().prepare(site)
        if site.weights is None:
            raise MethodError(
                f"{self.method.id} has not been trained: it needs the folder that `train` filled"
            )
        with reading("the trained network", site.weights):
            weights, facts = artifacts.kept(site.weights)
            self.box = Box.of_facts(facts)
            self.surveyed(site.weights, self.box)
            network = self.untrained(site.seed)
            network.load_state_dict(weights["network"])
        self.network = network.eval().requires_grad_(False).to(torch_device())

    def sent(self, pixels: Pixels, told: Any) -> Tensor:
        """What the network says."""
        return self.radiance(self.box.inside(pixels.places), pixels.material, told)
