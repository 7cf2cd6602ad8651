"""Tensors in files that are whole or not there."""

from __future__ import annotations

import os
import pickle
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import torch

from gibench.baselines.training.errors import CheckpointError, StorageError

UNREADABLE = (OSError, EOFError, RuntimeError, KeyError, ValueError, TypeError, pickle.UnpicklingError)
"""Errors that reading a damaged file of torch raises."""


def write_tensors(path: Path, content: Mapping[str, Any]) -> None:
    """Write tensors, numbers, text, lists and dicts: beside, synced, renamed.

    Raises StorageError where the disk refuses; what was there under the name before is then untouched, and nothing
    else is left behind.
    """
    beside = path.with_name(f".{path.name}.partial-{os.getpid()}")
    try:
        with open(beside, "wb") as file:
            torch.save(dict(content), file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, path)
    except BaseException as problem:
        with suppress(OSError):
            beside.unlink()
        # torch wraps what the system says in a complaint about its own file.
        refused = problem if isinstance(problem, OSError) else problem.__context__
        if isinstance(problem, (OSError, RuntimeError)) and isinstance(refused, OSError):
            raise StorageError(
                f"{path} cannot be written ({refused.strerror}): make room and run the same command again; "
                "nothing that was written before is lost",
                refused,
            ) from problem
        raise


def read_tensors(path: Path, device: torch.device | str = "cpu") -> dict[str, Any]:
    """Read what `write_tensors` wrote, without running any code that a file might hold.

    Raises CheckpointError where the file is not there or damaged.
    """
    try:
        content = torch.load(path, weights_only=True, map_location=device)
        if not isinstance(content, dict):
            raise ValueError("holds something else")
    except UNREADABLE as problem:
        raise CheckpointError(unreadable(path, problem)) from problem
    return content


def unreadable(path: Path, problem: BaseException) -> str:
    """Error message for a file that holds something else than it should."""
    first = (str(problem).splitlines() or [type(problem).__name__])[0]
    return f"{path} cannot be read ({first}): remove it, and it is made anew"
