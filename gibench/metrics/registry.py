"""Descriptors of the metrics, and the list of all."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal, TypeVar

from gibench.metrics.errors import UnknownMetricError

Function = TypeVar("Function", bound=Callable[..., Any])


@dataclass(frozen=True, kw_only=True)
class Descriptor:
    """One metric.

    Attributes:
        name: its name in `evaluate`, in tables and in files.
        function: what computes it.
        direction: which way is better.
        range: the smallest and the largest value it can take.
        identity: its value for equal images; None where that depends on the reference.
        units: the unit of its value; "1" for a pure number.
        values: what it takes: "linear" radiance or "display" values in [0, 1].
        inputs: a single "image" (or a batch), or a "sequence" of frames with their motion.
        reference: the publication that defines it.
        options: the keyword arguments that tell this metric from others of the same function.
        of_mean_square: of a quadratic metric, its value from the mean of squared differences, which samples of the
            truth give without bias (`gibench.metrics.unbiased`).
        weight: of linear radiance, what differences are multiplied by before they are squared, from the reference; None
            for 1.
        derived: the metric whose value alone decides this one's, and how; `evaluate` computes that one once.
    """

    name: str
    function: Callable[..., Any]
    direction: Literal["lower", "higher"]
    range: tuple[float, float]
    identity: float | None
    units: str
    values: Literal["linear", "display"]
    inputs: Literal["image", "sequence"] = "image"
    reference: str
    options: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    derived: tuple[str, Callable[[Any], Any]] | None = None
    of_mean_square: Callable[[float], float] | None = None
    weight: Callable[[Any], Any] | None = None

    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        """Compute the metric with its own options."""
        return self.function(*arguments, **self.options, **keywords)

    def accepts(self, keyword: str) -> bool:
        """Tell whether the function takes this keyword, such as "mask" or "map"."""
        return keyword in inspect.signature(self.function).parameters

    def better(self, first: float, second: float) -> bool:
        """Tell whether the first value is strictly better than the second."""
        return first < second if self.direction == "lower" else first > second


METRICS: dict[str, Descriptor] = {}
"""Every metric by name, in the order in which `gibench.metrics` lists their modules."""


def register(**description: Any) -> Callable[[Function], Function]:
    """Enter the decorated function in the registry; takes the fields of `Descriptor` but the function.

    Raises:
        ValueError: when the name is taken already, since one of the two would be lost in silence.
    """

    def enter(function: Function) -> Function:
        descriptor = Descriptor(function=function, **description)
        if descriptor.name in METRICS:
            raise ValueError(f"two metrics are named {descriptor.name!r}")
        METRICS[descriptor.name] = descriptor
        return function

    return enter


def metric(name: str) -> Descriptor:
    """Find a metric by its name.

    Raises:
        UnknownMetricError: with the names that exist.
    """
    try:
        return METRICS[name]
    except KeyError:
        raise UnknownMetricError(f"no metric is named {name!r}; there are: {', '.join(METRICS)}") from None
