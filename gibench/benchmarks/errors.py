"""The named errors of the benchmark; every one of them is a `GibenchError` with a message of one line."""

from __future__ import annotations

from gibench.errors import GibenchError


class TrackError(GibenchError):
    """A track, a preset or a setting that does not exist or makes no sense."""


class RegistryError(GibenchError):
    """A method that is not there, that two packages claim, or whose entry point does not load."""


class ResultsError(GibenchError):
    """A folder of results that is none, is of another version, or is damaged."""


class RunError(GibenchError):
    """A run stopped half-way; the results that are whole stay valid."""


class Interrupted(RunError):
    """The user stopped a run; the message says how to continue."""
