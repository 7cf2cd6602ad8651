"""Books which items of a sequence were handed out, so that whoever took them is charged for them."""

from __future__ import annotations

import mmap


class Booking:
    """Marks, one a thing, that processes which are forked off share.

    Sending it to a process that is not forked books everything: what happens there cannot be seen.
    """

    def __init__(self, count: int) -> None:
        """Nothing is booked yet."""
        self._count = count
        self._marks = mmap.mmap(-1, max(count, 1))  # anonymous memory, shared with children

    def book(self, index: int) -> None:
        """Thing number `index` was handed out."""
        self._marks[index] = 1

    def book_all(self) -> None:
        """All of them were."""
        self._marks[: self._count] = b"\1" * self._count

    @property
    def booked(self) -> list[int]:
        """Numbers of those that were handed out, ascending."""
        return [index for index, mark in enumerate(self._marks[: self._count]) if mark]

    def __reduce__(self) -> tuple[type[Booking], tuple[int]]:
        self.book_all()
        return Booking, (self._count,)
