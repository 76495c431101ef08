"""Sequences whose items are computed when they are read, so that only some of them are in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import TypeVar, overload

T = TypeVar("T")
_KEPT = 4


class Computed(Sequence[T]):
    """``count`` items, each computed by ``item`` from its number; those read last are kept."""

    def __init__(self, count: int, item: Callable[[int], T], kept: int = _KEPT) -> None:
        self._count = count
        self._item = lru_cache(kept)(item)

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, number: int) -> T: ...
    @overload
    def __getitem__(self, number: slice) -> list[T]: ...
    def __getitem__(self, number: int | slice) -> T | list[T]:
        """Return item ``number``, which counts from the end if it is negative, or those of a slice."""
        if isinstance(number, slice):
            return [self._item(one) for one in range(self._count)[number]]
        return self._item(range(self._count)[int(number)])

    def __iter__(self) -> Iterator[T]:
        return (self._item(number) for number in range(self._count))
