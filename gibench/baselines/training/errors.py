"""Errors of a training."""

from gibench.errors import GibenchError


class TrainingError(GibenchError):
    """A training that cannot begin or go on."""


class CheckpointError(TrainingError):
    """A checkpoint or a file of weights that cannot be read, or that is of another training."""


class StorageError(CheckpointError, OSError):
    """A disk that refuses a checkpoint or weights; `errno` says why."""

    def __init__(self, message: str, problem: OSError) -> None:
        """problem: what the system said."""
        OSError.__init__(self, problem.errno, message, problem.filename)

    def __str__(self) -> str:
        return str(self.strerror)
