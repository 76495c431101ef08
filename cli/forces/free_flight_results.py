"""Computes, prints and writes the results of ``wingfit forces``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import typer

from wingfit.cli.base.files import read_bytes, write_text
from wingfit.cli.base.output import note, number, say, table
from wingfit.records import LowPass, Recording
from wingfit.records.description.convert import describe_recording
from wingfit.records.description.yaml_text import write_yaml
from wingfit.records.files.number_table import Table, header_of, read_table, require
from wingfit.records.files.table import write_table
from wingfit.report.charts import Chart, Curve, chart_page
from wingfit.service.units import PASCAL_PER_MBAR, ZERO_CELSIUS
from wingfit.tracking.free_flight import Body, FreeFlight, free_flight, recording

__all__ = ["CUTOFF_PER_BEAT", "PASCAL_PER_MBAR", "ZERO_CELSIUS", "LowPass", "recording"]

CENTRE = "centre_of_mass"
AXES = "xyz"
CUTOFF_PER_BEAT = 3.2


def write(flight: FreeFlight, made: Recording, output: Path | None, details: Path | None) -> None:
    """Write CSV: the recording ``made`` to ``output``, all forces, moments and motion of ``flight`` to ``details``."""
    if output:
        channels = [f"{channel}_n" for channel in made.channels]
        write_text(output, write_table(channels, made.times, made.values), "forces")
        note(f"save it as recordings/{made.name}.csv of a dataset with the entry below")
    if details:
        write_text(details, _details(flight), "details")


def entry(made: Recording, *, starts_at_beat: bool) -> None:
    """Print the entry for dataset.yaml that describes the recording ``made``.

    ``starts_at_beat``: whether the start of a beat is known; if not, a note says how to give it.
    """
    if not starts_at_beat:
        say("note: times are those of the tracks; give --beat-start-s, since a recording must start with a beat")
    say(write_yaml({"recordings": [describe_recording(made)]}).rstrip())


def read_flight(tracks: Path, body: Path, mass_kg: float, low_pass: LowPass, inertia: str) -> FreeFlight:
    """Compute forces and motion from two CSV files: marker ``tracks`` over time, and marker positions on the ``body``.

    ``inertia``: "Ixx,Iyy,Izz,Ixz" in kg m^2 about the centre of mass, or "" for no moments.
    """
    shape = _table(body, "marker")
    places = dict(zip(shape.labels, np.stack([shape.column(f"{a}_m") for a in AXES], axis=-1), strict=True))
    if CENTRE not in places:
        raise ValueError(f"{shape.file} has no row {CENTRE!r}; add it with the position of the centre of mass")
    centre = places.pop(CENTRE)
    if not np.isfinite([centre, *places.values()]).all():
        raise ValueError(
            f"{shape.file} has empty cells; give every marker and the {CENTRE} three coordinates in metres"
        )
    data = _table(tracks, columns=["time_s", *(f"{name}_{axis}_m" for name in places for axis in AXES)])
    seen = np.stack([data.track(name) for name in places], axis=1)
    rigid = Body(np.stack(list(places.values())), centre, mass_kg, _inertia(inertia) if inertia else None)
    return free_flight(data.times(), seen, rigid, low_pass)


def _table(path: Path, label: str | None = None, columns: Sequence[str] = ()) -> Table:
    raw = read_bytes(path)
    header = header_of(raw, path.name)
    if len(header) > 1:  # else read_table reports the wrong separator or the empty file
        require(header, columns, path.name)
    return read_table(raw, path.name, label)


def _inertia(text: str) -> npt.NDArray[np.float64]:
    try:
        xx, yy, zz, xz = (float(part) for part in text.split(","))
    except ValueError:
        message = f"{text}: give four numbers in kg m^2, such as 2e-5,4e-5,5e-5,0"
        raise typer.BadParameter(message, param_hint="--inertia") from None
    tensor = np.array([[xx, 0, -xz], [0, yy, 0], [-xz, 0, zz]])
    if np.linalg.eigvalsh(tensor)[0] <= 0:
        raise typer.BadParameter(
            f"{text}: not positive definite; no rigid body has this inertia", param_hint="--inertia"
        )
    return tensor


def report(flight: FreeFlight) -> None:
    """Print the forces with their standard deviations, the noise of the markers, and the mean motion."""
    rows = []
    for k, axis in ((0, "x"), (2, "z")):
        force, deviation = flight.force[:, k], flight.force_deviation[:, k]
        numbers = (np.nanmean(force), np.nanstd(force), np.sqrt(np.nanmean(deviation**2)), np.nanmax(deviation))
        rows.append([f"force {axis}", *(number(float(value), 3) for value in numbers)])
    table(["", ">mean N", ">RMS about it", ">standard deviation", ">largest"], rows)
    known, noise = int(np.isfinite(flight.force[:, 0]).sum()), flight.noise
    say(f"{known} of {len(flight.times)} frames; noise per coordinate: {number(1000 * noise.deviation, 3)} mm")
    pitch = np.degrees(flight.pitch)
    speed = float(np.linalg.norm(np.nanmean(flight.velocity, axis=0)))
    climb = float(np.nanmean(flight.velocity[:, 2]))
    say(
        f"mean speed {number(speed, 3)} m/s, climbing {number(climb, 2)} m/s; body pitch "
        f"{float(np.nanmean(pitch)):.1f} deg, from {np.nanmin(pitch):.1f} to {np.nanmax(pitch):.1f}"
    )
    say(f"zero-phase low-pass at {number(flight.low_pass.cutoff, 3)} Hz, order {flight.low_pass.order}")
    if abs(climb) > 0.2 * speed:
        say("note: the flight is not level; body pitch and airspeed of the recording assume level flight")
    for remark in flight.remarks:
        say(f"note: {remark}")


def _details(flight: FreeFlight) -> str:
    series = {
        "force_{}_n": flight.force,
        "force_{}_sd_n": flight.force_deviation,
        "moment_{}_n_m": flight.moment,
        "moment_{}_sd_n_m": flight.moment_deviation,
        "velocity_{}_m_s": flight.velocity,
        "turn_rate_{}_rad_s": flight.rate,
    }
    given = {name: values for name, values in series.items() if values is not None}
    columns = [name.format(axis) for name in given for axis in AXES] + ["body_pitch_deg"]
    values = np.column_stack([*given.values(), np.degrees(flight.pitch)])
    return write_table(columns, flight.times, values)


def write_plot(flight: FreeFlight, path: Path, title: str) -> None:
    """Write an HTML page that plots the forces x and z over time, with a band of two standard deviations."""
    charts = []
    for axis in "xz":
        k = AXES.index(axis)
        force, spread = flight.force[:, k], 2 * flight.force_deviation[:, k]
        band = Curve("2 standard deviations", flight.times, force, band=(force - spread, force + spread))
        charts.append(Chart(f"Force {axis}", "time, s", "N", [band, Curve("force", flight.times, force)]))
    write_text(path, chart_page(title, charts), "plots")
