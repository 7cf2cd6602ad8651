"""Training of the reconstruction network for one scene: a step, the held-out view, and when to stop.

All random numbers of an epoch come from the seed and the epoch's number, so a training that was killed goes on from
its last checkpoint to the very weights of one that was not.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from gibench.baselines.efficient_light_probes import losses
from gibench.baselines.efficient_light_probes.examples import Example
from gibench.baselines.efficient_light_probes.network import ReconstructionNetwork, Scale
from gibench.baselines.method import Setting, Site, reading
from gibench.baselines.sources import digest
from gibench.baselines.training import artifacts
from gibench.baselines.training.budget import LOOKS, Budget
from gibench.baselines.training.checkpoints import Checkpoint
from gibench.baselines.training.crops import Window, random_window
from gibench.baselines.training.curves import Trained
from gibench.baselines.training.learner import Learner, Step
from gibench.baselines.training.loop import train
from gibench.baselines.training.losses.pixels import absolute
from gibench.baselines.training.reproducible import seeded
from gibench.baselines.training.schedule import half_cosine, set_rate
from gibench.metrics.lpips_network import build_network
from gibench.metrics.tone_map import reference_exposure
from gibench.rendering.backend import torch_device

BATCH = 2
"""Crops a step: many small steps learn more in the same time than few large ones."""

RATE = 3e-3
"""Of Adam at the start; it falls along half a cosine to nothing. The paper names neither."""

LARGEST_GRADIENT = 1.0
"""Norm that gradients are cut down to: one bright highlight must not undo an epoch."""

PERCEPTUAL_EVERY, PERCEPTUAL_SIDE = 4, 64
"""Steps from one with the perceptual loss to the next, each with as much more weight, and pixels along a side of what
it looks at in one crop: VGG16 costs more than all else."""

PATIENCE = 0.5
"""Share of the epochs that may pass without a better image of the held-out view: it swings while steps are large."""


@dataclass(frozen=True)
class TrainingPlan:
    """Settings of a training, beside its examples.

    epochs: passes over the views. crop: pixels along a side. fusion: of the network. lpips: whether there is the
    perceptual loss, temporal: earlier frames in the inputs and the temporal loss.
    """

    epochs: int
    crop: int
    fusion: str
    lpips: bool
    temporal: bool
    seed: int

    @staticmethod
    def of(settings: Mapping[str, Setting], seed: int) -> TrainingPlan:
        """From the settings of the method."""
        return TrainingPlan(
            int(settings["epochs"]),
            int(settings["crop"]),
            str(settings["fusion"]),
            bool(settings["lpips"]),
            bool(settings["temporal"]),
            seed,
        )


@dataclass(frozen=True, eq=False)
class Network:
    """A trained network on the CPU, the scale of its scene, and the epoch whose weights it has (0: untrained)."""

    network: ReconstructionNetwork
    scale: Scale
    epoch: int


def trained_network(
    site: Site, plan: TrainingPlan, settings: Mapping[str, Setting], examples: Callable[[], Sequence[Example]]
) -> Network:
    """The network of a site, trained where it is not there yet.

    settings: what decides the examples, beside the code that makes them. Raises MethodError where there are too few
    training views, WeightsError where the perceptual loss has no weights, TrainingError where the training fails.
    """
    # Read even where the network is there: whoever uses it pays for the views that it learned from.
    views = hashlib.sha256()
    for frame in site.training:
        views.update(repr(frame.camera).encode() + frame["color"].tobytes())
    key = {
        **settings,
        **asdict(plan),
        "views": views.hexdigest(),
        "seconds": site.seconds,
        "torch": torch.__version__,
    }
    owner = {"method": "elp", "sources": digest(__name__), "views": views.hexdigest(), **asdict(plan)}

    def make(folder: Path) -> float:
        checkpoint = Checkpoint(site.bakes.checkpoint(folder), owner)
        learner = Reconstructing(examples(), plan)
        trained = learner.trained(checkpoint, site.seconds)
        epoch = trained.best.step // learner.steps_of_epoch
        artifacts.keep(folder, trained, epoch=epoch, **asdict(learner.scale))
        return trained.before

    folder = site.bakes.get("training", key, make, using=[examples]).folder
    return _read(folder, plan.fusion)


def _read(folder: Path, fusion: str) -> Network:
    with reading("the trained network", folder):
        weights, facts = artifacts.kept(folder)
        network = ReconstructionNetwork(fusion)
        network.load_state_dict(weights["network"])
        scale = Scale(float(facts["exposure"]), float(facts["depth"]))
        return Network(network, scale, int(facts["epoch"]))


def scale_of(examples: Sequence[Example]) -> Scale:
    """Exposure and depth that all views of a scene share."""
    truth = np.stack([example.truth.movedim(0, -1).numpy() for example in examples])
    depth = torch.cat([example.guides[0].flatten() for example in examples])
    hit = depth[depth > 0]
    return Scale(float(reference_exposure(truth, shared=True)), float(hit.median()) if hit.numel() else 1.0)


class Crops(NamedTuple):
    """Batch of a step: examples, a window of each, and the window within these for the perceptual loss."""

    examples: list[Example]
    windows: list[Window]
    perceptual: Window | None


class Reconstructing(Learner):
    """The reconstruction network of a scene, which learns from all of its views but the last."""

    def __init__(self, examples: Sequence[Example], plan: TrainingPlan, device: str | None = None) -> None:
        """examples: two at least. device: of torch; where none is given that of the variant."""
        self.plan = plan
        device = device or torch_device()
        self.scale = scale_of(examples)
        self.learned, self.held_out = list(examples[:-1]), examples[-1]
        with seeded(plan.seed):
            self.network = ReconstructionNetwork(plan.fusion)
        self.network.to(device)
        self.lpips_network = build_network("vgg").to(device) if plan.lpips else None
        optimiser = torch.optim.Adam(self.network.parameters(), lr=RATE, fused=True)
        super().__init__({"network": self.network}, {"network": optimiser})

    @property
    def steps_of_epoch(self) -> int:
        """In a pass over the views."""
        return math.ceil(len(self.learned) / BATCH)

    @property
    def budget(self) -> Budget:
        """Whole epochs, and looks at their ends."""
        epochs = self.plan.epochs
        every = max(1, epochs // LOOKS)
        patience = max(every, math.ceil(PATIENCE * epochs))
        return Budget(
            steps=epochs * self.steps_of_epoch,
            look_every=every * self.steps_of_epoch,
            patience=(patience + 1) // every * every * self.steps_of_epoch,
        )

    def trained(self, checkpoint: Checkpoint | None = None, seconds: float | None = None) -> Trained:
        """Train to the end, until the held-out view gets no better, or until the seconds are over."""
        budget = replace(self.budget, seconds=seconds)
        return train(self, self.batches, budget, seed=self.plan.seed, checkpoint=checkpoint, title="elp")

    def batches(self, first: int) -> Iterator[Crops]:
        """Crops from that step on, without end."""
        epoch, skipped = divmod(first, self.steps_of_epoch)
        while True:
            sequence = np.random.SeedSequence(self.plan.seed, spawn_key=(1, epoch))
            generator = np.random.default_rng(sequence)
            order = generator.permutation(len(self.learned))
            for number in range(self.steps_of_epoch):
                chosen = [self.learned[k] for k in order[number * BATCH : (number + 1) * BATCH]]
                # Drawn for the steps that are skipped too: an epoch has one sequence of random numbers.
                crops = self._crops(chosen, epoch * self.steps_of_epoch + number, generator)
                if number >= skipped:
                    yield crops
            epoch, skipped = epoch + 1, 0

    def _crops(self, chosen: list[Example], step: int, generator: np.random.Generator) -> Crops:
        windows = [random_window(one.truth.shape[-2:], self.plan.crop, generator) for one in chosen]
        perceptual = None
        if self.lpips_network is not None and step % PERCEPTUAL_EVERY == 0:
            perceptual = random_window(windows[0][2:], PERCEPTUAL_SIDE, generator)
        return Crops(chosen, windows, perceptual)

    def error(self) -> Tensor:
        """Of the held-out view: mean absolute difference of compressed radiance."""
        one = self.held_out
        color, guides, truth = (part[None].to(self.device) for part in (one.color, one.guides, one.truth))
        output = self.network(self.scale.compressed(color), self.scale.guides(guides))
        return absolute(output.clamp(min=0), self.scale.compressed(truth))

    def step(self, batch: Crops, now: Step) -> dict[str, Tensor]:
        """Down equation 9, on the crops of a step."""
        epoch, number = divmod(now.number, self.steps_of_epoch)
        progress = (epoch + number / self.steps_of_epoch) / self.plan.epochs
        set_rate(self.optimisers["network"], RATE * half_cosine(progress))
        loss = self._loss(batch)
        self.descend("network", loss, largest_gradient=LARGEST_GRADIENT)
        return {"loss": loss}

    def _loss(self, batch: Crops) -> Tensor:
        scale, count = self.scale, len(batch.examples)
        crops = [
            example.cropped(window) for example, window in zip(batch.examples, batch.windows, strict=True)
        ]

        def stacked(name: str) -> Tensor:
            return torch.stack([getattr(crop, name) for crop in crops]).to(self.device)

        color, guides, truth = stacked("color"), stacked("guides"), stacked("truth")
        image, buffers = scale.compressed(color), scale.guides(guides)
        if self.plan.temporal:
            image = torch.cat([image, scale.compressed(stacked("before"))])
            buffers = torch.cat([buffers, scale.guides(stacked("guides_before"))])
        outputs = self.network(image, buffers).split(count)
        output = outputs[0]
        loss = losses.ABSOLUTE * absolute(output, scale.compressed(truth))
        if self.plan.temporal:
            motion, valid = stacked("motion"), stacked("valid")
            loss = loss + losses.TEMPORAL * losses.temporal(output, outputs[1], motion, valid)
        if self.lpips_network is not None and batch.perceptual is not None:
            part, known = (batch.perceptual.of(image[:1]) for image in (output, truth))
            lpips = losses.perceptual(self.lpips_network, scale.radiance(part), known, scale.exposure)
            loss = loss + PERCEPTUAL_EVERY * losses.PERCEPTUAL * lpips
        return loss
