"""The named error of imported scenes."""

from __future__ import annotations

from gibench.errors import GibenchError


class SceneFileError(GibenchError):
    """A scene file that cannot be imported. The message says what is wrong, where in the file, and what to do."""


class NoPlaceForCamera(SceneFileError):
    """A scene in which no view can be drawn, though it may be rendered by cameras that are given."""
