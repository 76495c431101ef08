"""Types of the answers about a file of a tracking system (docs/importing.md)."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Len
from typing_extensions import TypedDict

from wingfit.client.answers import Point
from wingfit.client.importing.questions import ImportQuestion

Coordinates = Annotated[list[float], Len(3, 3)]


class FileContents(TypedDict):
    """What was read of a file, before its numbers have a unit: ``labels`` of its markers, count of ``frames``.

    ``low`` and ``high`` are the smallest and largest x, y, z of all positions as they are in the file (its own unit and
    axes); null if there is no position.
    """

    labels: list[str]
    frames: int
    low: Coordinates | None
    high: Coordinates | None


class ImportStatement(TypedDict):
    """One fact about the tracks: its ``value``, stated ``by`` the file or the user, and ``where``."""

    fact: Literal["unit", "rate", "times", "axes", "up", "first frame"]
    value: str
    by: Literal["file", "user"]
    where: str


class ImportGaps(TypedDict):
    """Counts of missing positions by cause."""

    empty: int
    nan: int
    zeros: int
    residual: int
    partial: int


class ImportedMarker(TypedDict):
    """One marker: ``name`` in a dataset, ``label`` in the file, fraction of frames that show it, range, largest jump.

    ``largest_jump_m`` is the largest distance between two consecutive frames that show it, at ``jump_time_s``; null if
    there are none.
    """

    name: str
    label: str
    seen: float
    low_m: Coordinates
    high_m: Coordinates
    largest_jump_m: float | None
    jump_time_s: float | None


class TracksPreview(TypedDict):
    """Every ``stride``-th frame of the tracks: ``time_s`` [n], ``positions_mm`` [n][marker][3], null in gaps."""

    stride: int
    time_s: list[float]
    positions_mm: list[list[Point]]


class ImportedTracksInfo(TypedDict):
    """Everything about imported tracks, and a preview of their positions.

    ``frame`` is "wing" if the axes are x aft, y outboard, z up; "body" if they are x to the nose, y right, z down;
    "file" if they are those of the file, because the user has not stated how the wing lies in them.
    """

    frames: int
    start_s: float
    duration_s: float
    rate_hz: float
    frame: Literal["wing", "body", "file"]
    statements: list[ImportStatement]
    gaps: ImportGaps
    markers: list[ImportedMarker]
    remarks: list[str]
    preview: TracksPreview


class TrackImport(TypedDict):
    """What was understood of a file; ``tracks`` is null while there are ``questions``.

    ``format`` and ``title`` name the format; they are null if it is among the questions. ``contents`` is null if the
    file cannot be read before the questions are answered.
    """

    file: str
    format: str | None
    title: str | None
    contents: FileContents | None
    questions: list[ImportQuestion]
    tracks: ImportedTracksInfo | None


class DescribedFact(TypedDict):
    """One number of a first description: ``what``, its ``value``, and its ``source``: tracks, user, or assumed."""

    what: str
    value: str
    source: str


class FirstDescription(TypedDict):
    """A description from tracks alone: ``yaml`` is the key ``wing`` of dataset.yaml, or ``rig`` and ``channels``.

    ``conditions``: keys of a recording of a wing in dataset.yaml that are assumed.
    """

    kind: Literal["wing", "series"]
    yaml: str
    flap_frequency_hz: float | None
    conditions: dict[str, str | float]
    facts: list[DescribedFact]
