"""Errors of shapes."""

from gibench.errors import GibenchError


class ShapeError(GibenchError):
    """Sizes or points from which no closed surface can be made."""
