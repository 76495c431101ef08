"""Reads the forces in one file of a balance."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from wingfit.importers.forces.resolve import Balance, ForceOptions, ImportedForces, resolve
from wingfit.importers.forces.table import read_table
from wingfit.importers.forces.tdms import START, read_tdms
from wingfit.importers.limits import MAX_TRACK_FILE_BYTES
from wingfit.importers.options import Decimal
from wingfit.importers.source import open_source
from wingfit.records.errors import check_most, fail
from wingfit.records.limits import MIB


def import_forces(
    path: str | PathLike[str],
    *,
    unit: str | None = None,
    rate_hz: float | None = None,
    time_unit: str | None = None,
    axes: str | None = None,
    balance: Balance | None = None,
    body_pitch_deg: float | None = None,
    start_s: float | None = None,
    columns: str | None = None,
    group: str | None = None,
    decimal: Decimal = "point",
) -> ImportedForces:
    """Read the forces in a table or TDMS file of a balance, in newtons and body axes (x to the nose, z down).

    Args:
        path: the file.
        unit: of the forces: N, mN, uN, kN, gf, kgf or lbf; needed if the file does not state it.
        rate_hz: samples per second; needed if the file states neither a rate nor times.
        time_unit: of a column of times that does not state it: s, ms or us.
        axes: where Fx, Fy, Fz point, as forces of the wings on the body: "x nose, y right, z down".
        balance: "body" if the balance turns with the body, "wind" if its axes are those of the stream.
        body_pitch_deg: body pitch, nose up from the stream; needed for wind axes.
        start_s: time in the file at which a beat starts, which becomes 0.
        columns: which columns are what, if their names do not show it: "time=t; fx=ch1; fz=ch3" (roles time, fx, fy,
            fz, lift, drag, thrust).
        group: group of a TDMS file, if several have forces.
        decimal: "comma" if a table has decimal commas.

    Returns:
        The forces, with what was stated by whom, and remarks.

    Raises:
        DatasetError: lists what is wrong with the file, which options are missing, or which contradict the file.

    """
    options = ForceOptions(unit, rate_hz, time_unit, axes, balance, body_pitch_deg, start_s)
    options.check()
    place = Path(path)
    try:
        if place.is_dir():
            raise fail(place.name, str(place), "is a folder; name a file in it")
        size = place.stat().st_size / MIB
        check_most(place.name, "has", size, MAX_TRACK_FILE_BYTES / MIB, "MiB", "cut the recording in parts")
        raw = place.read_bytes()
    except OSError as error:
        raise fail(place.name, str(place), f"cannot be read: {error.strerror or error}; check the path") from None
    if not raw:
        raise fail(place.name, 0, "the file is empty (0 bytes); export it again")
    if raw.startswith(START):
        channels = read_tdms(raw, place.name, columns, group)
    else:
        source = open_source(raw, place.name)
        if source.encoding is None:
            raise fail(place.name, None, "is binary and no TDMS file; export the channels as CSV or TSV")
        channels = read_table(source, columns, decimal)
    return resolve(channels, options, place.name)
