"""Converts what was understood of a file of a tracking system to the answers that the API sends."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from wingfit.client.importing import answers as i
from wingfit.client.importing.questions import ImportQuestion
from wingfit.importers.inspection import Inspection, preview_frames, ranges
from wingfit.importers.raw import Raw
from wingfit.importers.start import ASSUMED, Start
from wingfit.importers.summary import as_json
from wingfit.importers.tracks import ImportedTracks

_MM_DECIMALS = 3
_OF_FILE = ("file", "format")  # of the tracks, which the answer has beside them


def imported(found: Inspection) -> i.TrackImport:
    """Return the answer about a file without faults; it may have questions."""
    return {
        "file": found.file,
        "format": found.reader.name if found.reader else None,
        "title": found.reader.title if found.reader else None,
        "contents": _contents(found.raw) if found.raw else None,
        "questions": questions(found),
        "tracks": _tracks(found.tracks) if found.tracks else None,
    }


def description(start: Start) -> i.FirstDescription:
    """Return the answer about a first description."""
    return {
        "kind": "wing" if start.kind == "wing" else "series",
        "yaml": start.yaml,
        "flap_frequency_hz": start.flap_frequency_hz[0] if start.flap_frequency_hz else None,
        "conditions": dict(ASSUMED) if start.kind == "wing" else {},
        "facts": [{"what": one.what, "value": one.value, "source": one.source} for one in start.facts],
    }


def questions(found: Inspection) -> list[ImportQuestion]:
    """Return the options that the file does not state."""
    return [
        {"option": one.option, "message": one.message, "choices": [*one.choices], "hint": one.hint}
        for one in found.questions
    ]


def _contents(raw: Raw) -> i.FileContents:
    low, high = ranges(raw.positions) or (None, None)
    return {"labels": [*raw.labels], "frames": len(raw.positions), "low": low, "high": high}


def _tracks(tracks: ImportedTracks) -> i.ImportedTracksInfo:
    known: dict[str, Any] = {name: value for name, value in as_json(tracks).items() if name not in _OF_FILE}
    return cast(i.ImportedTracksInfo, known | {"preview": _preview(tracks)})


def _preview(tracks: ImportedTracks) -> i.TracksPreview:
    frames = preview_frames(tracks)
    millimetres = np.round(1e3 * tracks.positions[:: frames.step], _MM_DECIMALS).astype(object)
    millimetres[np.isnan(tracks.positions[:: frames.step])] = None
    return {
        "stride": frames.step,
        "time_s": tracks.times[:: frames.step].tolist(),
        "positions_mm": millimetres.tolist(),
    }
