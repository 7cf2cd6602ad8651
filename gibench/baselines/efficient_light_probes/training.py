"""Training of the reconstruction network for one scene: losses, checkpoints, and when to stop.

All random numbers of an epoch come from the seed and the epoch's number, so a training that was killed goes on from
its last checkpoint to the very weights of one that was not. On a GPU so do those of torch's own kernels.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import pickle
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from torch import Tensor, nn

from gibench.baselines.efficient_light_probes import losses
from gibench.baselines.efficient_light_probes.examples import Example, camera_of
from gibench.baselines.efficient_light_probes.network import ReconstructionNetwork, Scale
from gibench.baselines.method import MethodError, Setting, Site
from gibench.metrics.lpips_network import build_network
from gibench.metrics.tone_map import reference_exposure

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

LOOKS = 50
"""How often the held-out view is looked at, and a checkpoint written, at most."""

QUIET_SECONDS = 30.0
"""Between two lines of progress where there is no terminal."""

WEIGHTS = "weights.pt"

UNREADABLE = (OSError, EOFError, RuntimeError, KeyError, ValueError, pickle.UnpicklingError)
"""What reading a damaged file of torch raises."""


@dataclass(frozen=True)
class Plan:
    """What decides a training, beside its examples.

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
    def of(settings: Mapping[str, Setting], seed: int) -> Plan:
        """From the settings of the method."""
        return Plan(
            int(settings["epochs"]),
            int(settings["crop"]),
            str(settings["fusion"]),
            bool(settings["lpips"]),
            bool(settings["temporal"]),
            seed,
        )


@dataclass(frozen=True, eq=False)
class Trained:
    """A network on the CPU, the scale of its scene, and the epoch whose weights it has (0: untrained)."""

    network: ReconstructionNetwork
    scale: Scale
    epoch: int


def trained_network(
    site: Site, plan: Plan, settings: Mapping[str, Setting], examples: Callable[[], Sequence[Example]]
) -> Trained:
    """The network of a site, trained where it is not there yet.

    settings: what decides the examples, beside the code that makes them. Raises MethodError where there are too few
    training views, WeightsError where the perceptual loss has no weights.
    """
    # Read even where the network is there: whoever uses it pays for the views that it learned from.
    views = hashlib.sha256()
    for frame in site.training:
        views.update(repr(camera_of(frame)).encode() + frame["color"].tobytes())
    key = {
        **settings,
        **asdict(plan),
        "views": views.hexdigest(),
        "torch": torch.__version__,
    }

    def make(folder: Path) -> float:
        checkpoint = site.bakes.checkpoint(folder)
        training = Training(examples(), plan)
        before = training.resume(checkpoint)
        training.run(checkpoint)
        torch.save(
            {"network": training.best, "epoch": training.best_epoch, **asdict(training.scale)},
            folder / WEIGHTS,
        )
        return before

    folder = site.bakes.get("training", key, make, using=[examples]).folder
    return _read(folder, plan.fusion)


def _read(folder: Path, fusion: str) -> Trained:
    try:
        stored = torch.load(folder / WEIGHTS, weights_only=True)
        network = ReconstructionNetwork(fusion)
        network.load_state_dict(stored["network"])
    except UNREADABLE as problem:
        raise MethodError(
            f"the trained network in {folder} cannot be read ({_first_line(problem)}): remove that folder"
        ) from problem
    return Trained(network, Scale(stored["exposure"], stored["depth"]), stored["epoch"])


def _first_line(problem: Exception) -> str:
    return (str(problem).splitlines() or [type(problem).__name__])[0]


def scale_of(examples: Sequence[Example]) -> Scale:
    """Exposure and depth that all views of a scene share."""
    truth = np.stack([example.truth.movedim(0, -1).numpy() for example in examples])
    depth = torch.cat([example.guides[0].flatten() for example in examples])
    hit = depth[depth > 0]
    return Scale(float(reference_exposure(truth, shared=True)), float(hit.median()) if hit.numel() else 1.0)


@contextlib.contextmanager
def _deterministic() -> Iterator[None]:
    """Only algorithms of torch that give the same bits every time."""
    before = torch.are_deterministic_algorithms_enabled()
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
    torch.use_deterministic_algorithms(True)
    try:
        yield
    finally:
        torch.use_deterministic_algorithms(before)


class Training:
    """A training on the way.

    best, best_epoch: the weights with the smallest error of the held-out view, the last one, and when that was.
    """

    def __init__(self, examples: Sequence[Example], plan: Plan, device: str | None = None) -> None:
        """examples: two at least. device: of torch, a GPU where there is one."""
        self.plan = plan
        self.device = device or ("cuda" if torch.cuda.is_available() else "cpu")
        self.scale = scale_of(examples)
        self.learned, self.held_out = list(examples[:-1]), examples[-1]
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(plan.seed)
            network = ReconstructionNetwork(plan.fusion)
        self.network = network.to(self.device)
        self.optimiser = torch.optim.Adam(self.network.parameters(), lr=RATE)
        self.judge = build_network("vgg").to(self.device) if plan.lpips else None
        self.epoch = 0
        self.seconds = 0.0
        self.best, self.best_epoch, self.best_error = _copied(self.network), 0, self.error()

    @property
    def every(self) -> int:
        """Epochs between two looks at the held-out view."""
        return max(1, self.plan.epochs // LOOKS)

    def run(self, checkpoint: Path | None = None) -> None:
        """Train from where it is to the end, or until the held-out view gets no better."""
        started = time.perf_counter() - self.seconds
        patience = max(self.every, math.ceil(PATIENCE * self.plan.epochs))
        with _deterministic(), _telling(self.plan.epochs) as tell:
            while self.epoch < self.plan.epochs and self.epoch - self.best_epoch <= patience:
                loss = self._pass()
                self.epoch += 1
                if self.epoch % self.every == 0 or self.epoch == self.plan.epochs:
                    self._look()
                    self.seconds = time.perf_counter() - started
                    if checkpoint is not None:
                        self._save(checkpoint)
                tell(self.epoch, loss, self.best_error)

    @torch.no_grad()
    def error(self) -> float:
        """Of the held-out view: mean absolute difference of compressed radiance."""
        one = self.held_out
        color, guides, truth = (part[None].to(self.device) for part in (one.color, one.guides, one.truth))
        output = self.network(self.scale.compressed(color), self.scale.guides(guides))
        return float(losses.absolute(output.clamp(min=0), self.scale.compressed(truth)))

    def _look(self) -> None:
        error = self.error()
        if error < self.best_error:
            self.best, self.best_epoch, self.best_error = _copied(self.network), self.epoch, error

    def _pass(self) -> float:
        """One epoch; the mean loss."""
        generator = np.random.default_rng(np.random.SeedSequence(self.plan.seed, spawn_key=(1, self.epoch)))
        order = generator.permutation(len(self.learned))
        steps = [order[first : first + BATCH] for first in range(0, len(order), BATCH)]
        total = 0.0
        for number, chosen in enumerate(steps):
            progress = (self.epoch + number / len(steps)) / self.plan.epochs
            for group in self.optimiser.param_groups:
                group["lr"] = RATE * 0.5 * (1 + math.cos(math.pi * progress))
            perceptual = (self.epoch * len(steps) + number) % PERCEPTUAL_EVERY == 0
            loss = self._loss([self.learned[k] for k in chosen], generator, perceptual)
            self.optimiser.zero_grad(set_to_none=True)
            loss.backward()
            nn.utils.clip_grad_norm_(self.network.parameters(), LARGEST_GRADIENT)
            self.optimiser.step()
            total += float(loss.detach())
        return total / len(steps)

    def _loss(self, chosen: Sequence[Example], generator: np.random.Generator, perceptual: bool) -> Tensor:
        """Equation 9 on a random crop of each example. perceptual: whether this is a step with that loss."""
        scale, device = self.scale, self.device
        crops = [_cropped(example, self.plan.crop, generator) for example in chosen]
        parts = [torch.stack(part).to(device) for part in zip(*crops, strict=True)]
        color, guides, truth, before, guides_before, motion, valid = parts
        image, buffers = scale.compressed(color), scale.guides(guides)
        if self.plan.temporal:
            image = torch.cat([image, scale.compressed(before)])
            buffers = torch.cat([buffers, scale.guides(guides_before)])
        outputs = self.network(image, buffers).split(len(chosen))
        output = outputs[0]
        loss = losses.ABSOLUTE * losses.absolute(output, scale.compressed(truth))
        if self.plan.temporal:
            loss = loss + losses.TEMPORAL * losses.temporal(output, outputs[1], motion, valid)
        if self.judge is not None and perceptual:
            top, left, height, width = _window(output.shape[-2:], PERCEPTUAL_SIDE, generator)
            part = (slice(0, 1), slice(None), slice(top, top + height), slice(left, left + width))
            seen = losses.perceptual(self.judge, scale.radiance(output[part]), truth[part], scale.exposure)
            loss = loss + PERCEPTUAL_EVERY * losses.PERCEPTUAL * seen
        return loss

    def _save(self, path: Path) -> None:
        state = {
            "network": self.network.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "epoch": self.epoch,
            "seconds": self.seconds,
            "best": self.best,
            "best_epoch": self.best_epoch,
            "best_error": self.best_error,
        }
        partial = path.with_name(f"{path.name}.{os.getpid()}")
        torch.save(state, partial)
        partial.replace(path)

    def resume(self, path: Path) -> float:
        """Go on from a checkpoint where there is one; the seconds that it has cost."""
        if not path.is_file():
            return 0.0
        try:
            state: dict[str, Any] = torch.load(path, weights_only=True, map_location=self.device)
            self.network.load_state_dict(state["network"])
            self.optimiser.load_state_dict(state["optimiser"])
        except UNREADABLE as problem:
            raise MethodError(
                f"the checkpoint {path} cannot be read ({_first_line(problem)}): remove it"
            ) from problem
        self.epoch, self.seconds = state["epoch"], state["seconds"]
        self.best, self.best_epoch, self.best_error = (
            state["best"],
            state["best_epoch"],
            state["best_error"],
        )
        return self.seconds


def _copied(network: nn.Module) -> dict[str, Tensor]:
    return {name: value.detach().cpu().clone() for name, value in network.state_dict().items()}


def _window(size: Sequence[int], side: int, generator: np.random.Generator) -> tuple[int, int, int, int]:
    """Top, left, height and width of a random window within an image of that (height, width)."""
    height, width = (min(side, length) for length in size)
    top = int(generator.integers(size[0] - height + 1))
    left = int(generator.integers(size[1] - width + 1))
    return top, left, height, width


def _cropped(example: Example, side: int, generator: np.random.Generator) -> list[Tensor]:
    top, left, height, width = _window(example.truth.shape[-2:], side, generator)
    return [part[:, top : top + height, left : left + width] for part in vars(example).values()]


@contextlib.contextmanager
def _telling(epochs: int) -> Iterator[Callable[[int, float, float], None]]:
    """Tell how far a training is: a bar on a terminal, a line now and then elsewhere."""
    console = Console(stderr=True)
    if not console.is_terminal:
        said = time.monotonic()

        def say(epoch: int, loss: float, error: float) -> None:
            nonlocal said
            if time.monotonic() - said >= QUIET_SECONDS or epoch == epochs:
                said = time.monotonic()
                console.print(
                    f"epoch {epoch}/{epochs}, loss {loss:.4f}, held out {error:.4f}", soft_wrap=True
                )

        yield say
        return
    bar = Progress(
        TextColumn("epoch {task.completed}/{task.total}"),
        BarColumn(bar_width=None),
        TextColumn("{task.fields[state]}"),
        TimeRemainingColumn(compact=True),
        console=console,
        transient=True,
    )
    with bar:
        task = bar.add_task("", total=epochs, state="")
        yield lambda epoch, loss, error: bar.update(
            task, completed=epoch, state=f"loss {loss:.4f} held out {error:.4f}"
        )
