"""What a reader returns: numbers as they are in the file, and what the file states about them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from wingfit.importers.numbers import Layout, Samples
from wingfit.importers.options import Given
from wingfit.importers.source import Source
from wingfit.records.array_types import Array, Float, Index, Int, Mask

V = TypeVar("V")


@dataclass(frozen=True)
class Stated(Generic[V]):
    """A ``value`` that the file states, and ``where`` in the file: "line 3, Units"."""

    value: V
    where: str


@dataclass(eq=False)
class Raw:
    """Tracks in the file's own unit and axes.

    Attributes:
        labels: names [M] as in the file.
        positions: [T, M, 3] in the file's unit. A missing coordinate is NaN: positive for an empty cell, with the sign
            bit set where the file writes the word NaN (:mod:`wingfit.importers.numbers`).
        lines: [T], the line of each frame for messages, or its number from 1 in a binary file.
        line_word: what ``lines`` counts: "line" or "frame".
        row_word: what a rate counts: "frames" of cameras, or "samples".
        frames: numbers [T] of the frames in the capture, or None if the file has none: consecutive frames.
        first: the number that the first frame of a capture has; it is at time 0.
        times: [T] as the file gives them, in ``time_unit``; None if it has none.
        time_unit: unit of ``times``.
        times_where: place of ``times``.
        unit: of ``positions``, as the file writes it.
        rates: frames per second; several where the file states the rate in several places.
        up: the axis that the file calls vertical, such as "+Z".
        frame_count: count of frames that the file states.
        invalid: [T, M], points that the file marks as invalid; None if the format has no such mark.
        remarks: what the user should know.
        row_choices: takes times or numbers of frames [T] that do not increase; returns the values of the option
            ``rows``, each of which selects frames for which they do; none if there is no such option.
        unit_hint, rate_hint: facts about the format that help to choose a missing option.
    """

    labels: list[str]
    positions: Float[Array, "T M 3"]
    lines: Int[Index, " T"]
    line_word: str = "line"
    row_word: str = "frames"
    frames: Int[Index, " T"] | None = None
    first: int = 0
    times: Float[Array, " T"] | None = None
    time_unit: Stated[str] | None = None
    times_where: str = ""
    unit: Stated[str] | None = None
    rates: list[Stated[float]] = field(default_factory=list)
    up: Stated[str] | None = None
    frame_count: Stated[int] | None = None
    invalid: Mask | None = None
    remarks: list[str] = field(default_factory=list)
    row_choices: Callable[[Array | Index], Sequence[str]] = lambda _: ()
    unit_hint: str = ""
    rate_hint: str = ""


def raw_of(layout: Layout, samples: Samples, **stated: Any) -> Raw:
    """Return the tracks of a text file; ``stated``: the other attributes of Raw."""
    return Raw(layout.labels, samples.positions, samples.lines, times=samples.times, frames=samples.frames, **stated)


@dataclass(frozen=True)
class Reader:
    """One format: its ``name`` for ``--format``, its ``title``, and its two functions.

    ``recognises(source)`` says from the first lines or bytes whether this is the format; it must not raise.
    ``read(source, given)`` returns the tracks, or raises DatasetError. ``needs_name``: the content may also be
    something else (tracks of one camera), so that the user must give ``--format``; the text says why, "" for no.
    """

    name: str
    title: str
    recognises: Callable[[Source], bool]
    read: Callable[[Source, Given], Raw]
    needs_name: str = ""
