"""What goes wrong when a shape is asked for."""

from gibench.errors import GibenchError


class ShapeError(GibenchError):
    """Sizes or points from which no closed surface can be made."""
