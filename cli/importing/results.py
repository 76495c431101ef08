"""Prints and writes the results of ``wingfit import``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from wingfit.cli.base.files import write_text
from wingfit.cli.base.output import number, percent, remarks, say, table
from wingfit.client.transport import WingfitError
from wingfit.importers import ImportedTracks
from wingfit.importers.summary import MarkerSummary, summaries
from wingfit.importers.summary import as_json as tracks_json
from wingfit.records.errors import counted

NOT_GIVEN = "of the file; how they lie in the wing is not stated"


def write(found: list[ImportedTracks], targets: list[Path]) -> list[Path | None]:
    """Write the tracks to the ``targets``, one for each file or none at all; return what was written for each."""
    if not targets:
        return [None] * len(found)
    for tracks, target in zip(found, targets, strict=True):
        try:
            target.parent.mkdir(exist_ok=True)
        except OSError as error:
            raise WingfitError(f"cannot make the folder {target.parent}", error.strerror or str(error)) from error
        write_text(target, tracks.csv(), f"tracks of {tracks.file}")
    return [*targets]


def as_json(tracks: ImportedTracks, written: Path | None) -> dict[str, Any]:
    """Return what was read as JSON, with the file that was ``written``."""
    return tracks_json(tracks) | {"written": None if written is None else str(written)}


def show(tracks: ImportedTracks) -> None:
    """Print the facts and who stated them, the gaps, and a row for each marker."""
    frames = f"{counted(len(tracks.markers), 'marker')}, {len(tracks.times)} frames, {number(tracks.duration_s)} s"
    say(f"{tracks.file}: {tracks.title}, {frames}, {number(tracks.rate_hz)} frames per second")
    facts = [[one.fact, one.value, f"{one.by}: {one.where}"] for one in tracks.statements]
    if tracks.frame == "file":
        facts.append(["axes", NOT_GIVEN, "nobody"])
    table(["fact", "value", "stated by"], facts)
    gaps = ", ".join(f"{count} {cause}" for cause, count in vars(tracks.gaps).items() if count)
    say(f"missing positions: {tracks.gaps.total}{f' ({gaps})' if gaps else ''}")

    def cells(one: MarkerSummary) -> list[str]:
        ends = zip(one.low_m, one.high_m, strict=True)
        spans = [f"{1e3 * low:.1f} to {1e3 * high:.1f}" for low, high in ends]
        jump = "–" if one.largest_jump_m is None else f"{1e3 * one.largest_jump_m:.2f}"
        return [one.name, percent(one.seen), *spans, jump]

    table(["marker", ">seen", ">x mm", ">y mm", ">z mm", ">largest jump mm"], [cells(one) for one in summaries(tracks)])
    remarks(f"{tracks.file}: {one}" for one in tracks.remarks)
