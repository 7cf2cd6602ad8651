"""Checkpoints: all that a training needs to go on as if nothing had happened, and whose it is."""

from __future__ import annotations

import platform
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from gibench.baselines.training.errors import CheckpointError
from gibench.baselines.training.files import read_tensors, write_tensors

FORMAT = 1
"""Of the file."""

EVERY_SECONDS = 60.0
"""From one checkpoint to the next: what a training that is killed loses at most."""


def machine(device: torch.device) -> dict[str, Any]:
    """Facts that the bits of a step depend on beside the code: torch; its instructions, threads and device."""
    facts = {
        "torch": str(torch.__version__),
        "processor": platform.machine(),
        "instructions": torch.backends.cpu.get_cpu_capability(),
        "threads": torch.get_num_threads(),
        "gpu": torch.cuda.get_device_name(device) if device.type == "cuda" else "",
    }
    return {f"machine {name}": value for name, value in facts.items()}


class Checkpoint:
    """A file for the state of one training.

    owner: what the training is, as numbers and text by name: its method, the version of its code, its settings, the
    hash of its data. A file of another owner, or another machine, is refused.
    """

    def __init__(
        self, path: Path, owner: Mapping[str, str | int | float | bool], *, every: float | None = None
    ) -> None:
        """every: seconds from one write to the next, EVERY_SECONDS unless given; 0: after every step."""
        self.path, self.owner = path, dict(owner)
        self.every = EVERY_SECONDS if every is None else every
        self._written = time.monotonic()

    @property
    def due(self) -> bool:
        """Whether it is time to write."""
        return time.monotonic() - self._written >= self.every

    def write(self, state: Mapping[str, Any], owner: Mapping[str, Any]) -> None:
        """Replace the file. owner: what the loop adds. Raises StorageError; the file before is then still whole."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        content = {"format": FORMAT, "owner": {**self.owner, **owner}, "state": dict(state)}
        write_tensors(self.path, content)
        self._written = time.monotonic()

    def read(self, owner: Mapping[str, Any], device: torch.device) -> dict[str, Any] | None:
        """The state that was written last, None where there is no file. owner: what the loop adds.

        Raises CheckpointError for a damaged file, and for one of another training, with what differs.
        """
        if not self.path.exists():
            return None
        content = read_tensors(self.path, device)
        if content.get("format") != FORMAT or not {"owner", "state"} <= content.keys():
            raise CheckpointError(f"{self.path} is not a checkpoint of this version: remove it")
        theirs, ours = content["owner"], {**self.owner, **owner}
        differing = [name for name in {**ours, **theirs} if theirs.get(name) != ours.get(name)]
        if differing:
            told = ", ".join(
                f"{name}: {theirs.get(name)!r} there, {ours.get(name)!r} here" for name in differing
            )
            raise CheckpointError(f"{self.path} is of another training ({told}): remove it, or move it away")
        state: dict[str, Any] = content["state"]
        return state

    def remove(self) -> None:
        """Remove the file, once what was trained is kept elsewhere."""
        self.path.unlink(missing_ok=True)
