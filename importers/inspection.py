"""What is known of a file before all options are given, and a few frames of its tracks to look at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.importers.options import OptionFault
from wingfit.importers.raw import Raw, Reader
from wingfit.importers.tracks import ImportedTracks
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import DatasetError

PREVIEW_FRAMES = 300
PREVIEW_POSITIONS = 40_000  # of all markers, at most


@dataclass(eq=False)
class Inspection:
    """What was understood of a file.

    Attributes:
        file: its name.
        reader: of its format; None if the format was not recognised.
        raw: numbers and statements of the file; None if it could not be read.
        tracks: None if the file has faults, or if options are missing.
        error: the faults; None if there are none.
    """

    file: str
    reader: Reader | None = None
    raw: Raw | None = None
    tracks: ImportedTracks | None = None
    error: DatasetError | None = None

    @property
    def questions(self) -> list[OptionFault]:
        """Return the options that are missing, each once."""
        faults = [fault for fault in (self.error.errors if self.error else []) if isinstance(fault, OptionFault)]
        return list({fault.option: fault for fault in reversed(faults)}.values())[::-1]

    @property
    def settled_by_options(self) -> bool:
        """Return whether the file has no other faults than options that are missing."""
        return self.error is None or all(isinstance(fault, OptionFault) for fault in self.error.errors)


def ranges(positions: Float[Array, "T M 3"]) -> tuple[list[float], list[float]] | None:
    """Return smallest and largest x, y, z of all ``positions``; None if none is there."""
    flat = positions.reshape(-1, 3)
    if not np.isfinite(flat).any(axis=0).all():
        return None
    return np.nanmin(flat, axis=0).tolist(), np.nanmax(flat, axis=0).tolist()


def preview_frames(tracks: ImportedTracks) -> range:
    """Return the indices of a few frames, evenly spaced from the first on, for a preview of limited size."""
    most = max(1, min(PREVIEW_FRAMES, PREVIEW_POSITIONS // len(tracks.markers)))
    return range(0, len(tracks.times), -(-len(tracks.times) // most))
