"""The exception for a dataset that is not valid: it lists faults, each with what is wrong, where, and a remedy."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from wingfit.records.limits import MAX_ERRORS

_SHOWN = 80
_COMPARED = 1000  # names, of which at most _COMPARED_LENGTH characters: comparing more takes seconds
_COMPARED_LENGTH = 200


@dataclass(frozen=True)
class Fault:
    """One error: ``where`` (file with line or key), the wrong ``value`` as text or None, ``message`` with a remedy."""

    where: str
    value: str | None
    message: str

    def __str__(self) -> str:
        return f"{self.where}: {self.message}"


class DatasetError(ValueError):
    """Raised for a dataset that cannot be read or written.

    ``errors`` lists the first faults, at most ``MAX_ERRORS``; ``count`` is the number of all faults that were detected.
    ``where``, ``value`` and ``message`` are those of the first fault.
    """

    def __init__(self, errors: Sequence[Fault], count: int | None = None) -> None:
        if not errors:
            raise ValueError("a DatasetError needs at least one fault")
        self.errors = list(errors[:MAX_ERRORS])
        self.count = max(len(errors), count or 0)
        self.where = self.errors[0].where
        self.value = self.errors[0].value
        self.message = self.errors[0].message
        lines = [str(fault) for fault in self.errors]
        if self.count > len(self.errors):
            lines.append(f"and {self.count - len(self.errors)} more")
        super().__init__("\n".join(lines))

    def __reduce__(self) -> tuple[type[DatasetError], tuple[list[Fault], int]]:
        return type(self), (self.errors, self.count)


class Faults:
    """Collects faults, so that one DatasetError reports several; counts all, stores the first ``MAX_ERRORS``."""

    def __init__(self) -> None:
        self.faults: list[Fault] = []
        self.count = 0

    def add(self, where: str, value: object, message: str) -> None:
        """Add one fault: the ``message`` about a ``value`` at ``where`` (file with line or key)."""
        self.put(Fault(where, shown(value), message))

    def put(self, fault: Fault) -> None:
        """Add one ``fault``."""
        self.count += 1
        if len(self.faults) < MAX_ERRORS:
            self.faults.append(fault)

    def extend(self, error: DatasetError) -> None:
        """Add the faults that ``error`` lists, and count all that it counts."""
        self.faults.extend(error.errors[: MAX_ERRORS - len(self.faults)])
        self.count += error.count

    @property
    def full(self) -> bool:
        """Return whether ``MAX_ERRORS`` faults are counted: more are not stored, so that the search can stop."""
        return self.count >= MAX_ERRORS

    def raise_any(self) -> None:
        """Raise DatasetError with the collected faults, if there are any."""
        if self.faults:
            raise DatasetError(self.faults, self.count)


def fail(where: str, value: object, message: str) -> DatasetError:
    """Return a DatasetError with one fault, which the caller raises; the arguments are those of Fault."""
    return DatasetError([Fault(where, shown(value), message)])


def check_most(where: str, what: str, found: float, most: float, unit: str, remedy: str) -> None:
    """Raise DatasetError if ``found`` is more than ``most``.

    The message is "WHAT FOUND UNIT; at most MOST UNIT are read: REMEDY", with the arguments in capitals filled in;
    ``where`` is the file or place that it is about.
    """
    if found > most:
        number = f"{round(found, 1):.15g}"
        raise fail(where, number, f"{what} {number} {unit}; at most {most:.9g} {unit} are read: {remedy}".lstrip())


def counted(count: int, noun: str) -> str:
    """Return ``count`` with its ``noun``, of which the plural ends in s: "1 frame", "2 frames"."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def shown(value: object) -> str | None:
    """Return ``value`` as text of at most 80 characters for a message ("list of 3" for a container); None for None."""
    if value is None:
        return None
    if isinstance(value, (dict, list, tuple)):
        return f"{'mapping' if isinstance(value, dict) else 'list'} of {len(value)}"
    text = str(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}... ({len(text)} characters)"


def nearest(name: str, known: Iterable[str]) -> str:
    """Return a hint about the unknown ``name``: the most similar of the ``known`` names, or a list of these."""
    names = list(known)
    close = difflib.get_close_matches(name[:_COMPARED_LENGTH], names[:_COMPARED], 1, 0.6)
    if close:
        return f"did you mean {close[0]!r}?"
    listed = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
    return f"known: {listed}" if names else "there are none"


def decode(raw: bytes, file: str) -> str:
    """Decode the UTF-8 file ``raw``, drop a byte-order mark; DatasetError names the line with a wrong byte."""
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        byte = f"0x{raw[error.start]:02x}"
        message = f"byte {byte} is not UTF-8 text; save the file as UTF-8 (not UTF-16 or Latin-1)"
        raise fail(f"{file}, line {line}", byte, message) from None
