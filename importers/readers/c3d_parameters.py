"""Numbers and parameters of a C3D file, for the three kinds of processors that wrote such files.

Every length is checked against the end of the file, so that a damaged file ends in a DatasetError.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wingfit.records.array_types import Array
from wingfit.records.errors import fail

_INTEL, _DEC, _MIPS = 84, 85, 86
_SIZES = {-1: 1, 1: 1, 2: 2, 4: 4}
_MAX_TEXTS = 65_536

Reals = np.ndarray[Any, np.dtype[np.float32]]


@dataclass(frozen=True)
class Binary:
    """How numbers are stored: ``order`` of bytes, "<" or ">"; ``dec``: floats are those of DEC computers."""

    order: str
    dec: bool

    def word(self, raw: bytes, at: int) -> int:
        """Return the unsigned 16-bit number at byte ``at``."""
        return int(struct.unpack_from(self.order + "H", raw, at)[0])

    def signed(self, raw: bytes, at: int) -> int:
        """Return the signed 16-bit number at byte ``at``."""
        return int(struct.unpack_from(self.order + "h", raw, at)[0])

    def real(self, raw: bytes, at: int) -> float:
        """Return the 32-bit float at byte ``at``."""
        return float(self.reals(raw, at, 1)[0])

    def reals(self, raw: bytes, at: int, count: int) -> Reals:
        """Return ``count`` 32-bit floats from byte ``at`` on."""
        if not self.dec:
            return np.frombuffer(raw, self.order + "f4", count, at)
        # The 16-bit halves are swapped, and the exponent is larger by two.
        halves = np.frombuffer(raw, "<u2", 2 * count, at).reshape(-1, 2)[:, ::-1]
        with np.errstate(invalid="ignore"):
            reals: Reals = np.ascontiguousarray(halves).view("<f4").reshape(-1) * np.float32(0.25)
        return reals

    def integers(self, raw: bytes, at: int, count: int) -> np.ndarray[Any, np.dtype[np.int16]]:
        """Return ``count`` signed 16-bit numbers from byte ``at`` on."""
        return np.frombuffer(raw, self.order + "i2", count, at)


@dataclass
class Parameters:
    """Parameters by group and name, all in capitals; a value is a list of texts, or an array of numbers."""

    groups: dict[str, dict[str, list[str] | Array]] = field(default_factory=dict)

    def texts(self, group: str, name: str) -> list[str]:
        """Return the texts of a parameter; none if it is missing or holds numbers."""
        value = self.groups.get(group, {}).get(name)
        return value if isinstance(value, list) else []

    def numbers(self, group: str, name: str) -> Array:
        """Return the numbers of a parameter; none if it is missing or holds texts."""
        value = self.groups.get(group, {}).get(name)
        return value if isinstance(value, np.ndarray) else np.empty(0)

    def number(self, group: str, name: str, default: float) -> float:
        """Return the first number of a parameter, or ``default``."""
        values = self.numbers(group, name)
        return float(values[0]) if len(values) else default

    def words(self, group: str, name: str) -> list[int]:
        """Return the numbers of a parameter as unsigned 16-bit words; none if one is no such number."""
        values = self.numbers(group, name)
        fits = np.isfinite(values) & (np.abs(values) < 65_536)
        return [int(value) % 65_536 for value in values] if fits.all() else []


def read_parameters(raw: bytes, start: int, file: str) -> tuple[Binary, Parameters]:
    """Read the section of parameters that starts at byte ``start``; return how numbers are stored, and the parameters.

    DatasetError if the section is damaged or cut off.
    """
    if start + 4 > len(raw):
        raise fail(file, start, "its parameters are missing; the file is cut off: export it again")
    blocks, processor = raw[start + 2], raw[start + 3]
    if processor not in (_INTEL, _DEC, _MIPS):
        message = f"the type of processor is {processor}; it must be 84, 85 or 86: the file is damaged, export it again"
        raise fail(file, processor, message)
    binary = Binary(">" if processor == _MIPS else "<", processor == _DEC)
    end = min(len(raw), start + 512 * blocks) if blocks else len(raw)
    try:
        return binary, _read(raw[start:end], 4, binary)
    except (struct.error, ValueError, IndexError) as error:
        raise fail(file, None, f"its parameters are damaged ({error}); export the file again") from None


def _read(section: bytes, at: int, binary: Binary) -> Parameters:
    """Read all groups and parameters from byte ``at`` of the ``section``; exceptions of struct and numpy if damaged."""
    names: dict[int, str] = {}
    pending: list[tuple[int, str, list[str] | Array]] = []
    while at + 2 <= len(section):
        length, group = struct.unpack_from("bb", section, at)
        if length == 0 or group == 0:
            break
        name_end = at + 2 + abs(length)  # negative: the parameter is locked
        name = section[at + 2 : name_end].decode("latin-1").strip().upper()
        step = binary.word(section, name_end)
        if group < 0:
            names[-group] = name
        else:
            pending.append((group, name, _value(section, name_end + 2, binary)))
        if step == 0:
            break
        at = name_end + step
    found = Parameters()
    for group, name, value in pending:
        found.groups.setdefault(names.get(group, str(group)), {})[name] = value
    return found


def _value(section: bytes, at: int, binary: Binary) -> list[str] | Array:
    kind, dimensions = struct.unpack_from("bB", section, at)
    if kind not in _SIZES or dimensions > 7:
        raise ValueError(f"a type of {kind} with {dimensions} dimensions does not exist")
    shape = list(section[at + 2 : at + 2 + dimensions])
    count = int(np.prod(shape, dtype=np.int64)) if shape else 1
    at += 2 + dimensions
    if at + count * _SIZES[kind] > len(section):
        raise ValueError(f"{count} values do not fit into the section")
    if kind == -1:
        return _texts(section[at : at + count], shape)
    if kind == 1:
        return np.frombuffer(section, np.int8, count, at).astype(np.float64)
    numbers = binary.integers(section, at, count) if kind == 2 else binary.reals(section, at, count)
    with np.errstate(invalid="ignore"):
        return numbers.astype(np.float64)


def _texts(data: bytes, shape: list[int]) -> list[str]:
    """Return the texts in ``data``; the first of the dimensions in ``shape`` is their length."""
    width = shape[0] if shape else 1
    count = len(data) // width if width else 0
    if count > _MAX_TEXTS:
        raise ValueError(f"{count} texts are too many")
    texts = [data[i * width : (i + 1) * width] for i in range(count)]
    return [text.decode("utf-8", errors="replace").rstrip(" \0").strip() for text in texts]
