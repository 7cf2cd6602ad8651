"""The named errors and the one warning of the metrics."""

from __future__ import annotations

from gibench.errors import GibenchError


class MetricInputError(GibenchError, ValueError):
    """An argument that no metric can be computed from; the base of the errors below."""


class DtypeError(MetricInputError, TypeError):
    """An array whose type says nothing about its range, such as 8-bit integers."""


class ShapeError(MetricInputError):
    """Arrays that are not images, or whose shapes do not belong together."""


class NonFiniteError(MetricInputError):
    """NaN or infinity in an input."""


class RangeError(MetricInputError):
    """Finite values outside the range that the metric is defined on."""


class ImageTooSmallError(MetricInputError):
    """An image smaller than the window or the network that should look at it."""


class UnknownMetricError(MetricInputError):
    """A metric name that is not in the registry, or one that cannot be used in this place."""


class WeightsError(GibenchError, RuntimeError):
    """LPIPS weights that are missing, damaged, or do not fit the network."""


class MissingDependencyError(GibenchError, ImportError):
    """A package that this metric needs is not installed or cannot be imported."""


class EmptyMaskWarning(UserWarning):
    """A mask left no pixel to average over, so the result is NaN."""
