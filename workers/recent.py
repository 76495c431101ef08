"""A cache: a dictionary of limited size that discards the least recently used entry (LRU)."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


class Recent(OrderedDict[str, T]):
    """A dictionary of the ``most`` entries that were used last (an LRU cache); not thread-safe."""

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most

    def use(self, key: str, make: Callable[[], T]) -> T:
        """Return the entry of ``key``, made by ``make()`` if missing; a full cache drops the least recently used."""
        entry = self[key] if key in self else make()
        self[key] = entry
        self.move_to_end(key)
        if len(self) > self._most:
            self.popitem(last=False)
        return entry
