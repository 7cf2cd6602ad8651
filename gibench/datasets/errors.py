"""The named errors of datasets; every one of them is a `GibenchError` with a message of one line."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from gibench.errors import GibenchError


class RecipeError(GibenchError):
    """A recipe, or an option that overrides it, asks for something that does not exist or makes no sense."""


class FolderError(GibenchError):
    """The output folder cannot be used: it holds something else, is in use, or cannot be written."""


class MakingError(GibenchError):
    """Making a dataset stopped half-way; the rooms that are whole stay valid."""


class ClusterError(MakingError):
    """A cluster that does not answer, has no workers, or has some that would make other pixels."""


class BadScene(MakingError):
    """A scene file that turned out to be wrong while its room was made."""


class Interrupted(MakingError):
    """The user stopped the making; the message says how to continue."""


class StorageError(GibenchError):
    """A frame cannot be stored or read: a value that is not finite, a broken or foreign file."""


class UnknownChannel(StorageError, KeyError):
    """A frame has no channel of that name. It is a `KeyError` too, as indexing demands."""

    def __str__(self) -> str:
        """Return the message as it is: `KeyError` would put it into quotes."""
        return str(self.args[0])


class DatasetError(GibenchError):
    """A folder that is asked for as a dataset is none, is not finished, or contradicts itself."""


def nearest(name: str, known: Iterable[str]) -> str:
    """Say which known names a wrong one resembles, for the end of an error message.

    Returns "did you mean 'a' or 'b'?", or the list of all known names when none is near.
    """
    names = sorted(known)
    close = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
    if close:
        return "did you mean " + " or ".join(f"'{c}'" for c in close) + "?"
    return "known are " + ", ".join(names)
