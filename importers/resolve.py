"""Where the statements of a file and those of the user meet: metres, seconds, axes, names, gaps.

All options that are missing, and all that contradict the file, are reported at once.
"""

from __future__ import annotations

import numpy as np

from wingfit.importers.axes import EXAMPLE, read_axes
from wingfit.importers.limits import MAX_DISTANCE
from wingfit.importers.markers import Names, names_of
from wingfit.importers.options import UNITS, Given, ask, question, unit_of
from wingfit.importers.raw import Raw, Reader
from wingfit.importers.repeats import without_repeats
from wingfit.importers.times import resolve_times
from wingfit.importers.tracks import Gaps, ImportedTracks, Statement
from wingfit.records.array_types import Array, Mask
from wingfit.records.errors import DatasetError, Faults, counted, fail, shown
from wingfit.records.limits import MIN_FRAMES

_PIXELS = "px"
_METRES = 5.0  # numbers below it are more likely metres than millimetres, in an example
_MIRRORS = {
    "wing": "these axes mirror: right for a left wing in a right-handed frame, wrong for a right wing",
    "body": "these axes mirror, which is wrong unless the frame of the file is left-handed",
}


def resolve(raw: Raw, reader: Reader, given: Given, file: str) -> ImportedTracks:
    """Return the tracks of ``raw`` in metres and seconds; DatasetError lists missing and contradicting options."""
    _check_counts(raw, given, file)
    faults = Faults()
    unit = _unit(raw, given, file, faults)
    timing = None
    try:
        raw = without_repeats(raw, given)
        timing = resolve_times(raw, given, file, faults)
    except DatasetError as error:
        faults.extend(error)
    faults.raise_any()
    if unit is None or timing is None:
        raise fail(file, None, "unit and rate are missing")
    names = names_of(raw.labels, file, keep_unlabelled=given.keep_unlabelled)
    names = names if given.markers is None else names.chosen(given.markers)
    invalid = None if raw.invalid is None else raw.invalid[:, names.keep]
    positions, gaps = _without_gaps(raw.positions[:, names.keep], invalid, given)
    numerator, denominator = UNITS[unit.value]
    positions = positions * numerator / denominator
    _check_distance(positions, raw, names, unit, file)
    names, positions = _seen(names, positions, file)
    axes = None if given.axes is None else read_axes(given.axes)
    statements = [unit, *timing.statements]
    if raw.up:
        statements.append(Statement("up", raw.up.value, "file", raw.up.where))
    remarks = [*raw.remarks, *timing.remarks, *names.remarks]
    if axes:
        positions = axes.apply(positions)
        statements.append(Statement("axes", f"of the {axes.frame}; in the file {given.axes}", "user", "--axes"))
        if axes.mirrors:
            remarks.append(_MIRRORS[axes.frame])
        if raw.up and (direction := axes.direction_of("XYZ".index(raw.up.value[1]))) != _stated_up(raw.up.value):
            remarks.append(f"the file calls {raw.up.value} up ({raw.up.where}), and --axes says it is {direction}")
    else:
        remarks.append(f"the axes are those of the file; for those of the wing give, for example, --axes {EXAMPLE!r}")
    return ImportedTracks(
        file=file,
        format=reader.name,
        title=reader.title,
        markers=names.markers,
        labels=names.labels,
        times=timing.times,
        positions=np.ascontiguousarray(positions),
        frame=axes.frame if axes else "file",
        statements=tuple(statements),
        gaps=gaps,
        remarks=tuple(dict.fromkeys(remarks)),
    )


def _stated_up(text: str) -> str:
    return "up" if text[0] == "+" else "down"


def _check_counts(raw: Raw, given: Given, file: str) -> None:
    """Raise DatasetError if there are too few frames, or not as many as the file states."""
    frames = len(raw.positions)
    if raw.frame_count and raw.frame_count.value != frames:
        difference = f"has {counted(frames, 'frame')}, but states {raw.frame_count.value} ({raw.frame_count.where})"
        if not given.incomplete:
            cause = "it is cut off" if frames < raw.frame_count.value else "it was edited"
            remedy = "export it again, or give --incomplete to import what is there"
            raise ask("incomplete", file, frames, f"{difference}, so {cause}; {remedy}")
        raw.remarks.append(f"the file {difference}; these are imported")
    if frames < MIN_FRAMES:
        raise fail(
            file, frames, f"has {counted(frames, 'frame')}; at least {MIN_FRAMES} are needed: export a longer part"
        )


def _unit(raw: Raw, given: Given, file: str, faults: Faults) -> Statement | None:
    """Return the unit of positions and who stated it; add a fault if nobody did, or if file and user disagree."""
    stated = unit_of(raw.unit.value) if raw.unit else None
    if raw.unit and stated == _PIXELS:
        message = f"states pixels ({raw.unit.where}); triangulate first, and import tracks in units of length"
        faults.add(file, raw.unit.value, message)
        return None
    if raw.unit and stated:
        if given.unit and given.unit != stated:
            message = (
                f"is {given.unit}, but {file} states {stated} ({raw.unit.where}); leave it out, or correct the file"
            )
            faults.add("--unit", given.unit, message)
            return None
        return Statement("unit", stated, "file", raw.unit.where)
    if given.unit:
        return Statement("unit", given.unit, "user", "--unit")
    known = ", ".join(UNITS)
    why = f"states the unit {shown(raw.unit.value)!r}, which is unknown" if raw.unit else "states no unit of positions"
    seen = raw.positions[np.isfinite(raw.positions)]
    numbers = f"they are numbers from {seen.min():.4g} to {seen.max():.4g}" if seen.size else ""
    hint = f" ({raw.unit_hint or numbers})" if raw.unit_hint or numbers else ""
    example = "m" if seen.size and np.abs(seen).max() < _METRES else "mm"
    message = f"{why}{hint}; add it: --unit {example} (one of {known})"
    faults.put(question("unit", file, raw.unit.value if raw.unit else None, message, [*UNITS], raw.unit_hint))
    return None


def _without_gaps(positions: Array, invalid: Mask | None, given: Given) -> tuple[Array, Gaps]:
    """Return positions [T, M, 3] with NaN in all coordinates of a gap, and the gaps by cause; each has one cause."""
    missing = np.isnan(positions)
    word = np.any(missing & np.signbit(positions), axis=2)
    flagged = np.zeros(word.shape, dtype=np.bool_) if invalid is None else invalid
    there = np.logical_not(flagged)
    whole, some = np.all(missing, axis=2) & there, np.any(missing, axis=2) & there
    zeros = np.all(positions == 0, axis=2) & there & (not given.keep_zeros)
    gaps = Gaps(
        empty=int(np.sum(whole & np.logical_not(word))),
        nan=int(np.sum(whole & word)),
        zeros=int(np.sum(zeros)),
        residual=int(np.sum(flagged)),
        partial=int(np.sum(some)) - int(np.sum(whole)),
    )
    gap = np.logical_or(flagged, np.logical_or(some, zeros))
    return np.where(gap[..., None], np.nan, positions), gaps


def _check_distance(positions: Array, raw: Raw, names: Names, unit: Statement, file: str) -> None:
    """Raise DatasetError if a position (m) is so large that unit or file must be wrong."""
    size = np.where(np.isnan(positions), 0.0, np.abs(positions))
    if size.size and size.max() > MAX_DISTANCE:
        t, m, axis = np.unravel_index(int(size.argmax()), size.shape)
        where = f"{file}, {raw.line_word} {raw.lines[t]}, marker {names.labels[m]!r}, {'xyz'[axis]}"
        message = f"is {positions[t, m, axis]:.4g} m from the origin; at most {MAX_DISTANCE:g} m are plausible"
        remedy = f"check the unit ({unit.value}, {unit.where}), or remove the point"
        raise fail(where, f"{positions[t, m, axis]:.6g}", f"{message}: {remedy}")


def _seen(names: Names, positions: Array, file: str) -> tuple[Names, Array]:
    """Leave out markers that are never seen; DatasetError if none is seen."""
    seen: Mask = np.any(np.all(np.isfinite(positions), axis=2), axis=0)
    if not seen.any():
        remedy = "export another part; if zeros are positions, give --keep-zeros"
        raise fail(file, 0, f"no marker is seen in any of {len(positions)} frames; {remedy}")
    if seen.all():
        return names, positions
    return names.only(seen), positions[:, seen]
