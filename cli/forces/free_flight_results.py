"""What ``wingfit forces`` computes, prints, writes and draws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import typer

from wingfit.cli.base.files import write_text
from wingfit.cli.base.output import note, number, say, table
from wingfit.cli.loads import COLOURS
from wingfit.client.client import WingfitError
from wingfit.records import DatasetError, LowPass
from wingfit.records.description.convert import describe_recording
from wingfit.records.description.yaml_text import write_yaml
from wingfit.records.files.table import write_table
from wingfit.tracking.free_flight import Body, FreeFlight, free_flight, recording
from wingfit.tracking.tables import Table, header_of, read_table, require

CENTRE = "centre_of_mass"
AXES = "xyz"
CUTOFF_PER_BEAT = 3.2


@dataclass(frozen=True)
class Wanted:
    """The options of ``wingfit forces``."""

    tracks: Path
    body: Path
    mass_kg: float
    flap_hz: float
    output: Path | None
    details: Path | None
    plot: Path | None
    cutoff_hz: float | None
    order: int
    beat_start_s: float | None
    inertia: str
    pressure_mbar: float
    temperature_c: float


def estimate(wanted: Wanted) -> None:
    """Estimate the forces, print how well they are known, and write what is wanted; WingfitError where it fails."""
    try:
        flight = _flight(
            wanted.tracks,
            wanted.body,
            wanted.mass_kg,
            LowPass(wanted.cutoff_hz or CUTOFF_PER_BEAT * wanted.flap_hz, wanted.order),
            wanted.inertia,
        )
        name = wanted.output.stem if wanted.output else wanted.tracks.stem
        made = recording(
            flight,
            name,
            wanted.flap_hz,
            wanted.beat_start_s or 0.0,
            wanted.pressure_mbar * 100,
            wanted.temperature_c + 273.15,
        )
    except (DatasetError, ValueError) as error:
        raise WingfitError("no forces found", str(error)) from error
    if wanted.output:
        write_text(wanted.output, write_table([f"{channel}_n" for channel in made.channels], made.times, made.values))
        note(f"forces written to {wanted.output}; as recordings/{made.name}.csv they belong to the entry below")
    if wanted.details:
        write_text(wanted.details, _details(flight))
        note(f"details written to {wanted.details}")
    if wanted.plot:
        write_text(wanted.plot, _page(flight, f"Forces in free flight, {wanted.tracks.name}"))
        note(f"plots written to {wanted.plot}; open it in a browser")
    _report(flight)
    if wanted.beat_start_s is None:
        say("note: times are those of the tracks; give --beat-start-s, for forces must count from the start of a beat")
    say(write_yaml({"recordings": [describe_recording(made)]}).rstrip())


def _flight(tracks: Path, body: Path, mass_kg: float, low_pass: LowPass, inertia: str) -> FreeFlight:
    shape = _table(body, "marker")
    places = dict(zip(shape.labels, np.stack([shape.column(f"{a}_m") for a in AXES], axis=-1), strict=True))
    if CENTRE not in places:
        raise ValueError(f"{shape.file} has no row {CENTRE!r}; add it with the place of the centre of mass")
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
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise WingfitError(f"cannot read {path}", error.strerror or str(error)) from error
    header = header_of(raw, path.name)
    if len(header) > 1:  # else read_table tells the separator or an empty file
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
        raise typer.BadParameter(f"{text}: not positive; no body has such an inertia", param_hint="--inertia")
    return tensor


def _report(flight: FreeFlight) -> None:
    rows = []
    for k, axis in ((0, "x"), (2, "z")):
        force, deviation = flight.force[:, k], flight.force_deviation[:, k]
        numbers = (np.nanmean(force), np.nanstd(force), np.sqrt(np.nanmean(deviation**2)), np.nanmax(deviation))
        rows.append([f"force {axis}", *(number(float(value), 3) for value in numbers)])
    table(["", ">mean N", ">RMS about it", ">standard deviation", ">largest"], rows)
    known, noise = int(np.isfinite(flight.force[:, 0]).sum()), flight.noise
    say(f"{known} of {len(flight.times)} frames; a marker's noise is {number(1000 * noise.deviation, 3)} mm")
    pitch = np.degrees(flight.pitch)
    speed = float(np.linalg.norm(np.nanmean(flight.velocity, axis=0)))
    climb = float(np.nanmean(flight.velocity[:, 2]))
    say(
        f"mean speed {number(speed, 3)} m/s, climbing {number(climb, 2)} m/s; body pitch "
        f"{float(np.nanmean(pitch)):.1f} deg, from {np.nanmin(pitch):.1f} to {np.nanmax(pitch):.1f}"
    )
    say(f"zero-phase low-pass at {number(flight.low_pass.cutoff, 3)} Hz, order {flight.low_pass.order}")
    if abs(climb) > 0.2 * speed:
        say("note: the flight is not level; the recording's body pitch and airspeed stand for level flight")
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


def _page(flight: FreeFlight, title: str) -> str:
    """A page that needs nothing else: the forces with two standard deviations."""
    from plotly import graph_objects
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, subplot_titles=["force x, N", "force z, N"])
    for row, k in ((1, 0), (2, 2)):
        force, spread = flight.force[:, k], 2 * flight.force_deviation[:, k]
        for edge, fill in ((force + spread, None), (force - spread, "tonexty")):
            around = graph_objects.Scatter(
                x=flight.times, y=edge, mode="lines", line={"width": 0}, fill=fill, name="2 standard deviations"
            )
            figure.add_trace(around, row=row, col=1)
        line = {"width": 2, "color": COLOURS[row - 1]}
        figure.add_trace(graph_objects.Scatter(x=flight.times, y=force, name="force", line=line), row=row, col=1)
    figure.update_xaxes(title_text="time, s", row=2, col=1)
    figure.update_layout(title=title, height=700, template="plotly_white", showlegend=False)
    return str(figure.to_html(include_plotlyjs=True))
