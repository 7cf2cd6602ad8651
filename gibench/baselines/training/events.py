"""A log for TensorBoard, which is asked for and not needed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from gibench.baselines.training.errors import TrainingError

Write = Callable[[int, Mapping[str, float]], None]


@contextmanager
def events(folder: Path | None, first: int) -> Iterator[Write]:
    """Something to write numbers of a step to. first: the step that a training begins or goes on with; what an earlier
    run wrote about later ones is taken back. Raises TrainingError where tensorboard is not installed.
    """
    if folder is None:
        yield lambda step, values: None
        return
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError as problem:
        raise TrainingError(
            f"a log for TensorBoard needs it ({problem}): pip install tensorboard"
        ) from problem
    writer = SummaryWriter(folder, purge_step=first)

    def write(step: int, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            writer.add_scalar(name, value, step)

    try:
        yield write
    finally:
        writer.close()
