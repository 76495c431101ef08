"""The memory of an exported model: all its arrays in one block, which is saved, restored and copied as one.

The block is made of words of eight bytes. Its image at the start of a simulation is part of the FMU. The words that a
simulation changes lie behind those that it only reads, so that the state of a simulation is one piece of the block.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

WORD, LINE = 8, 8  # bytes of a word; words of a cache line, at which arrays begin
_VIEWS = {"f": "floats", "i": "integers", "b": "flags"}


class Words(NamedTuple):
    """An array in the memory: its first word, its shape, and the kind of its numbers ("f", "i" or "b")."""

    start: int
    shape: tuple[int, ...]
    kind: str


@dataclass
class Memory:
    """Arrays at fixed places in one block of words.

    Attributes:
        constant, changing: the arrays that are read only, and the others; in the order of their addition.
        texts: by name, how a compiled function makes a value from the variable ``memory``, an address.
    """

    constant: list[np.ndarray[Any, Any]] = field(default_factory=list)
    changing: list[np.ndarray[Any, Any]] = field(default_factory=list)

    def add(self, value: Any, *, changing: bool) -> None:
        """Add all arrays in ``value``: an array, a number, or a tuple of these, nested to any depth."""
        if isinstance(value, tuple):
            for part in value:
                self.add(part, changing=changing)
        elif isinstance(value, np.ndarray) and value.size and not self._has(value):
            if not value.flags.c_contiguous:
                raise ValueError(f"an array of shape {value.shape} is not contiguous")
            (self.changing if changing else self.constant).append(value)

    def _has(self, value: np.ndarray[Any, Any]) -> bool:
        return any(value.ctypes.data == other.ctypes.data for other in (*self.constant, *self.changing))

    @property
    def _places(self) -> list[tuple[np.ndarray[Any, Any], int]]:
        places, at = [], 0
        for array in (*self.constant, *self.changing):
            places.append((array, at))
            at += -(-array.nbytes // (WORD * LINE)) * LINE
        return places

    @property
    def size(self) -> int:
        """Number of all words."""
        return sum(-(-array.nbytes // (WORD * LINE)) * LINE for array in (*self.constant, *self.changing))

    @property
    def first_changing(self) -> int:
        """First word that a simulation changes; all after it may change."""
        return sum(-(-array.nbytes // (WORD * LINE)) * LINE for array in self.constant)

    def word(self, address: int) -> int:
        """Return the word at the ``address`` in this process, within one of the arrays; 0 if it is in none."""
        for array, at in self._places:
            if array.ctypes.data <= address < array.ctypes.data + array.nbytes:
                return at + (address - array.ctypes.data) // WORD
        return 0

    def image(self) -> bytes:
        """Return all words as they are now."""
        block = bytearray(WORD * self.size)
        for array, at in self._places:
            block[WORD * at : WORD * at + array.nbytes] = array.tobytes()
        return bytes(block)

    def text(self, value: Any, name: Callable[[Any], str]) -> str:
        """Return Python source that makes ``value`` of views of the block at the address ``memory``.

        ``name`` returns the name of a tuple's class in that source.
        """
        if isinstance(value, tuple):
            return f"{name(value)}({', '.join(self.text(part, name) for part in value)})"
        if isinstance(value, np.ndarray):
            view = _VIEWS[value.dtype.kind]
            at = self.word(value.ctypes.data) if value.size else 0
            return f"carray({view}(memory + {WORD * at}), {tuple(map(int, value.shape))})"
        return repr(value)


def relocated(rows: np.ndarray[Any, Any], memory: Memory, columns: Sequence[int]) -> list[tuple[int, int]]:
    """Return (word of an address, word that it is the address of) for the addresses in ``columns`` of ``rows`` [L, K].

    An address of zero is none.
    """
    start = memory.word(rows.ctypes.data) if rows.size else 0
    width = rows.shape[1]
    return [(start + k * width + c, memory.word(int(row[c]))) for k, row in enumerate(rows) for c in columns if row[c]]
