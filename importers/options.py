"""What the user states about a file: the options of ``wingfit import``, checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Literal, get_args

from wingfit.importers.axes import read_axes
from wingfit.importers.limits import MAX_RATE, MIN_RATE
from wingfit.records.errors import DatasetError, Fault, Faults, fail, nearest, shown

# Metres are value x numerator / denominator: one rounding, or two for feet and inches.
UNITS = {"m": (1, 1), "cm": (1, 100), "mm": (1, 1000), "um": (1, 1_000_000), "in": (254, 10_000), "ft": (3048, 10_000)}
TIME_UNITS = {"s": (1, 1), "ms": (1, 1000), "us": (1, 1_000_000)}
Decimal = Literal["point", "comma"]
REPEATED = ("gaps", "first")
_UNIT_WORDS = {
    "m": ("meter", "meters", "metre", "metres"),
    "cm": ("centimeter", "centimeters", "centimetre", "centimetres"),
    "mm": ("millimeter", "millimeters", "millimetre", "millimetres"),
    "um": ("µm", "μm", "micrometer", "micrometers", "micrometre", "micrometres", "micron", "microns"),
    "in": ("inch", "inches"),
    "ft": ("foot", "feet"),
    "px": ("pixel", "pixels"),
}
_UNIT_OF = {word: unit for unit, words in _UNIT_WORDS.items() for word in (unit, *words)}


@dataclass(frozen=True)
class Given:
    """Statements of the user about a file; None: not given.

    Attributes:
        unit: of positions, a key of ``UNITS``.
        rate_hz: frames per second.
        axes: where the axes of the file point, such as "x aft, y out, z up" (:mod:`wingfit.importers.axes`).
        format: name of the format, where the content does not decide it.
        time_unit: of a column of times, a key of ``TIME_UNITS``.
        decimal: what separates the decimals in a text file.
        columns: which columns a plain table has: "time=t; tip=a,b,c; root=d,e,f".
        rows: which rows of a plain table are read: "sequence=3,side=left".
        keep_zeros: positions that are exactly zero on all axes are seen, not missing.
        keep_unlabelled: markers that the capture program did not identify are imported too.
        incomplete: the file may have other than the count of frames that it states.
        markers: which markers are imported, "tip,root"; ``*`` stands for any letters: "right_*".
        repeated: what becomes of rows that have the same time: "gaps" merges them and leaves a gap where they differ,
            "first" keeps the first.
    """

    unit: str | None = None
    rate_hz: float | None = None
    axes: str | None = None
    format: str | None = None
    time_unit: str | None = None
    decimal: Decimal = "point"
    columns: str | None = None
    rows: str | None = None
    keep_zeros: bool = False
    keep_unlabelled: bool = False
    incomplete: bool = False
    markers: str | None = None
    repeated: str | None = None

    @staticmethod
    def names() -> tuple[str, ...]:
        """Return the names of all options."""
        return tuple(field.name for field in fields(Given))

    def check(self, formats: Sequence[str]) -> None:
        """Raise DatasetError, which names all options with a wrong value; ``formats``: the known names of formats."""
        faults = Faults()
        _choice("--unit", self.unit, UNITS, faults)
        _choice("--time-unit", self.time_unit, TIME_UNITS, faults)
        _choice("--format", self.format, formats, faults)
        _choice("--decimal", self.decimal, get_args(Decimal), faults)
        _choice("--repeated", self.repeated, REPEATED, faults)
        if self.rate_hz is not None and not MIN_RATE <= self.rate_hz <= MAX_RATE:
            limits = f"it must lie in [{MIN_RATE:g}, {MAX_RATE:g}] Hz"
            faults.add("--rate-hz", self.rate_hz, f"is {self.rate_hz:g} Hz; {limits}: give frames per second")
        if self.axes is not None:
            try:
                read_axes(self.axes)
            except DatasetError as error:
                faults.extend(error)
        faults.raise_any()


@dataclass(frozen=True)
class OptionFault(Fault):
    """A fault that an option of the user removes, so that a form can ask for it.

    Attributes:
        option: name of the option, an attribute of Given.
        choices: the values that the option may have; none if it is any number or text.
        hint: a fact that helps to choose, "" for none.
    """

    option: str = ""
    choices: tuple[str, ...] = ()
    hint: str = ""


def question(
    option: str, where: str, value: object, message: str, choices: Sequence[str] = (), hint: str = ""
) -> OptionFault:
    """Return the fault that ``option`` is missing; the other arguments are those of OptionFault."""
    return OptionFault(where, shown(value), message, option, tuple(choices), hint)


def ask(
    option: str, where: str, value: object, message: str, choices: Sequence[str] = (), hint: str = ""
) -> DatasetError:
    """Return a DatasetError with one OptionFault, which the caller raises."""
    return DatasetError([question(option, where, value, message, choices, hint)])


def _choice(option: str, value: str | None, known: Sequence[str] | dict[str, tuple[int, int]], faults: Faults) -> None:
    if value is not None and value not in known:
        faults.add(option, value, f"is {value!r}; it must be one of {', '.join(known)} ({nearest(value, known)})")


def unit_of(text: str) -> str | None:
    """Return the unit that ``text`` of a file names: a key of UNITS, or "px" for pixels; None if it is unknown."""
    return _UNIT_OF.get(text.strip().lower().removesuffix("."))


def pairs_of(option: str, text: str, separator: str, example: str) -> list[tuple[str, str]]:
    """Split ``text``, the value of ``option``, into (name, value) pairs; DatasetError for a part without "="."""
    pairs = []
    for part in filter(None, (part.strip() for part in text.split(separator))):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not (name and equals and value):
            raise fail(option, part, f"{shown(part)!r} is not NAME=VALUE; write it like {example!r}")
        pairs.append((name, value))
    if not pairs:
        raise fail(option, text, f"is empty; write it like {example!r}")
    return pairs
