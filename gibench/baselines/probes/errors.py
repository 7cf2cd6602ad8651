"""Errors of probes."""

from gibench.errors import GibenchError


class ProbeError(GibenchError, ValueError):
    """A scene without a place for probes, or a number of them or a size that cannot be."""
