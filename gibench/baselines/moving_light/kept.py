"""Examples of frames that are put together once, then kept in memory, in half precision, as long as there is room."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any, Generic, TypeVar

from torch import Tensor

KEPT = 1 << 30
"""Bytes of examples that are kept."""

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
        """Put one together, or take it from memory."""
        if index not in self._kept:
            example = self.made(index)
            halves = [part.half() if part.numel() > WHOLE else part for part in example]
            size = sum(part.numel() * part.element_size() for part in halves)
            if self._bytes + size > KEPT:
                return example
            self._kept[index] = _like(example, halves)
            self._bytes += size
        kept = self._kept[index]
        return _like(kept, (part.float() for part in kept))

    @abstractmethod
    def made(self, index: int) -> E:
        """Put one together."""


def _like(example: E, parts: Iterable[Tensor]) -> E:
    kind: Any = type(example)
    made: E = kind(*parts)
    return made
