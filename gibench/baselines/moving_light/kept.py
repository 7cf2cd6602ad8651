"""Examples of frames that are put together once, then kept in memory, in half precision, as long as there is room.

What a step sees is cut out of them before it is made single precision again: whole frames cost a tenth of a training.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any, Generic, TypeVar

from torch import Tensor

from gibench.baselines.image_to_image.frames import spaced

KEPT = 3 << 29
"""Bytes of examples that are kept."""

STARTED = 16
"""Examples that decide where a network begins."""

WHOLE = 16
"""Numbers of a tensor up to which it is kept as it is."""

E = TypeVar("E", bound=tuple[Tensor, ...])
"""A named tuple."""


class KeptExamples(ABC, Generic[E]):
    """Examples by number: named tuples of tensors, (C, H, W) each."""

    def __init__(self, count: int) -> None:
        """count: how many."""
        self._count = count
        self._kept: dict[int, E] = {}
        self._bytes = 0

    def __len__(self) -> int:
        """How many."""
        return self._count

    def __getitem__(self, index: int) -> E:
        """Put one together, or take it from memory: in half precision, but for its smallest tensors."""
        if index in self._kept:
            return self._kept[index]
        example = self.made(index)
        halves = _like(example, [part.half() if part.numel() > WHOLE else part for part in example])
        size = sum(part.numel() * part.element_size() for part in halves)
        if self._bytes + size <= KEPT:
            self._kept[index] = halves
            self._bytes += size
        return halves

    @abstractmethod
    def made(self, index: int) -> E:
        """Put one together."""


def widened(example: E) -> E:
    """In single precision."""
    return _like(example, (part.float() for part in example))


def some_of(examples: KeptExamples[E]) -> list[E]:
    """STARTED of them at most, spread evenly: networks begin at their mean."""
    return [widened(examples[index]) for index in spaced(range(len(examples)), STARTED)]


def _like(example: E, parts: Iterable[Tensor]) -> E:
    kind: Any = type(example)
    made: E = kind(*parts)
    return made
