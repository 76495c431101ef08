"""A mapping that holds the entries used last."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


class Recent(OrderedDict[str, T]):
    """The ``most`` entries used last, by key; not thread-safe."""

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most

    def use(self, key: str, make: Callable[[], T]) -> T:
        """The entry of ``key``, made by ``make`` if it is missing; the one that was not used for longest makes room."""
        entry = self[key] if key in self else make()
        self[key] = entry
        self.move_to_end(key)
        if len(self) > self._most:
            self.popitem(last=False)
        return entry
