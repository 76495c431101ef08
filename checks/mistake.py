"""What a check finds: a likely mistake in a dataset, with its place, its cause and the exact change."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Literal

from wingfit.records.array_types import Array, Float
from wingfit.records.description.yaml_text import Path, dotted
from wingfit.records.errors import Fault
from wingfit.records.mistake_kinds import MistakeKind

Kind = MistakeKind | Literal["not carried out"]

Alter = Callable[[Float[Array, " T"], Float[Array, "T C"], tuple[str, ...]], tuple[Array, Array]]
"""Returns changed copies of the times [T] and values [T, C] of a recording, whose channels have these names."""

SHOWN = 3  # recordings that a message names
EVERY = "all recordings"  # place of a mistake that all recordings together show


@dataclass(frozen=True)
class KeyEdit:
    """A change of one value in ``dataset.yaml``: the key at ``path`` from the text ``old`` to ``new``."""

    path: Path
    old: str
    new: str

    def __str__(self) -> str:
        return f"dataset.yaml, {dotted(self.path)}: {self.old} -> {self.new}"


@dataclass(frozen=True)
class TableEdit:
    """A change of the samples of one ``recording``: ``columns`` from ``old`` to ``new``, which ``alter`` computes."""

    recording: str
    columns: str
    old: str
    new: str
    alter: Alter

    def __str__(self) -> str:
        return f"recordings/{self.recording}.csv, {self.columns}: {self.old} -> {self.new}"


Edit = KeyEdit | TableEdit


@dataclass(frozen=True)
class Mistake:
    """One likely mistake in a dataset.

    Attributes:
        kind: what is wrong, as one of a few words.
        where: recording, marker or key.
        value: what the dataset has, and ``expected``: what it should have, both as text with units.
        cause: the likeliest cause.
        change: what to change, exactly: file, key or column, old and new value.
        certain: whether a dataset with it is refused; otherwise it is a warning.
        edits: the same change as data, empty where nobody but the user can make it.
        alone: whether the other recordings show that they do not have it.
    """

    kind: Kind
    where: str
    value: str
    expected: str
    cause: str
    change: str
    certain: bool = False
    edits: tuple[Edit, ...] = ()
    alone: bool = False

    @property
    def message(self) -> str:
        """Value, expected value, cause and change in one sentence."""
        return f"{self.value}; expected {self.expected}; likely cause: {self.cause}; change {self.change}"

    @property
    def fault(self) -> Fault:
        """The mistake as an entry of a DatasetError."""
        return Fault(self.where, self.value, self.message)

    def __str__(self) -> str:
        return f"{self.where}, {self.kind}: {self.message}"


def change_of(edits: Iterable[Edit]) -> str:
    """Return the text of a change that consists of ``edits``; of many alike only the first ones."""
    texts = [str(edit) for edit in edits]
    more = f" (and {len(texts) - SHOWN} more alike)" if len(texts) > SHOWN else ""
    return "; ".join(texts[:SHOWN]) + more


def together(mistakes: Iterable[Mistake], recordings: int) -> list[Mistake]:
    """Merge ``mistakes`` of single recordings that have the same kind and cause; ``recordings`` are in the dataset."""
    groups: dict[tuple[Kind, str, bool], list[Mistake]] = {}
    for one in mistakes:
        groups.setdefault((one.kind, one.cause, one.certain), []).append(one)
    return [_merged(group, recordings) for group in groups.values()]


def _merged(group: list[Mistake], recordings: int) -> Mistake:
    first = group[0]
    if len(group) == 1:
        return first
    edits = tuple(edit for one in group for edit in one.edits)
    names = ", ".join(one.where.removeprefix("recording ") for one in group[:SHOWN])
    more = f" and {len(group) - SHOWN} more" if len(group) > SHOWN else ""
    every = "all of them" if len(group) == recordings else f"{len(group)} of {recordings}"
    change = change_of(edits) if edits else first.change
    return replace(first, where=f"recordings {names}{more} ({every})", edits=edits, change=change)
