"""Reads a series of one recording from CSV: ``time_s``, then a column for each channel and input of the rig."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from wingfit.records.description.yaml_text import Document
from wingfit.records.errors import Faults, nearest
from wingfit.records.files.table import Layout, Samples, read_columns, read_table
from wingfit.records.limits import MAX_VALUES

_GAP = "a channel was not recorded"


@dataclass(frozen=True)
class Columns:
    """Units of the ``channels`` and ``inputs`` of a rig, by name; names of its ``settings``, which are no columns."""

    channels: dict[str, str]
    inputs: dict[str, str]
    settings: tuple[str, ...] = ()

    @classmethod
    def of(cls, document: Document) -> Columns:
        """Return those that ``document``, a checked description, lists."""
        units = {
            key: {one["name"]: str(one["unit"]) for one in document.data.get(key) or ()}
            for key in ("channels", "inputs")
        }
        return cls(units["channels"], units["inputs"], tuple(document.names("settings")))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all columns but that of the times: channels, then inputs."""
        return (*self.channels, *self.inputs)


def read_series(raw: bytes, file: str, columns: Columns, room: int = MAX_VALUES) -> Samples:
    """Read a series from the contents ``raw`` of a CSV ``file`` with at most ``room`` numbers.

    The values are in the order of ``columns``, whatever the order in the file. DatasetError names line and column of
    every error.
    """
    return read_table(raw, file, lambda header, where: _layout(header, where, columns), room, _GAP)


def _layout(header: Sequence[str], where: str, known: Columns) -> Layout:
    units = known.channels | known.inputs
    with_units = {f"{name}_{unit}": name for name, unit in units.items()}
    named = [name if name in units else with_units.get(name, name) for name in header]
    columns, faults = read_columns(named, where, lambda name: _problem(name, known, units), units), Faults()
    for name in units:
        if name not in columns:
            cells = "its cells may be empty" if name in known.channels else "an input needs a value in every row"
            faults.add(where, name, f"column {name!r} is missing; add it{_of(units[name])} ({cells})")
    faults.raise_any()
    return Layout(columns["time_s"], [columns[name] for name in units], quantities=known.names)


def _problem(name: str, known: Columns, units: dict[str, str]) -> str | None:
    if name in units:
        return None
    if name in known.settings:
        return f"{name!r} is a setting, one value for a recording; state it in dataset.yaml and remove the column"
    stem = re.split(r"[ \[(/]|_(?!.*_)", name, maxsplit=1)[0]
    if stem in units:
        return f"unknown column {name!r}; write {stem!r}, with values{_of(units[stem])}"
    hint = nearest(name, ("time_s", *units))
    return f"unknown column {name!r}; list it in dataset.yaml under channels or inputs, or remove it; {hint}"


def _of(unit: str) -> str:
    return " without unit" if unit == "1" else f" in {unit}"
