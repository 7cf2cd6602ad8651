"""Errors of requests for materials."""

from gibench.errors import GibenchError


class UnknownSlot(GibenchError):
    """A slot, material family or room kind that has no rule."""


class BadMaterial(GibenchError):
    """Material parameters that no surface can have, or that its family does not know."""
