"""``wingfit forces``: computes the forces on a vehicle in free flight from its tracked markers, without a server."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wingfit.cli.base.files import new_file, refused
from wingfit.cli.base.output import next_step


def forces(
    tracks: Annotated[Path, typer.Argument(help="CSV: time_s, MARKER_x_m, _y_m, _z_m, with z up.")],
    body: Annotated[
        Path, typer.Option(help="CSV: marker,x_m,y_m,z_m in body axes (x to the nose, z down); a row centre_of_mass.")
    ],
    mass_kg: Annotated[float, typer.Option(help="Mass of the vehicle, kg.", min=1e-6, max=100)],
    flap_hz: Annotated[float, typer.Option(help="Flap frequency.", min=0.01, max=2000)],
    output: Annotated[Path | None, new_file("Write the recording: FILE.csv.", "--output", "-o")] = None,
    details: Annotated[
        Path | None,
        new_file("Write all forces and moments with standard deviations, and the flight: FILE.csv.", "--details"),
    ] = None,
    plot: Annotated[Path | None, new_file("Plot forces with their errors: FILE.html.", "--plot")] = None,
    cutoff_hz: Annotated[float | None, typer.Option(help="Low-pass cut-off; default: 3.2 x flap frequency.")] = None,
    order: Annotated[int, typer.Option(help="Order of one pass of the Butterworth filter.", min=1, max=8)] = 4,
    beat_start_s: Annotated[
        float | None, typer.Option(help="Start of any beat, as 'wingfit kinematics' estimates it.")
    ] = None,
    inertia: Annotated[str, typer.Option(help="Ixx,Iyy,Izz,Ixz about the centre of mass, kg m^2: adds moments.")] = "",
    pressure_mbar: Annotated[float, typer.Option(help="Air pressure.", min=1, max=2000)] = 1013.25,
    temperature_c: Annotated[float, typer.Option(help="Air temperature.", min=-100, max=100)] = 20.0,
) -> None:
    """Estimate the forces on a vehicle in free flight from its tracked markers: F = m (a - g) in body axes.

    Prints the forces with their standard deviations, and the entry of the recording for dataset.yaml. The vehicle is
    treated as one rigid body: use only markers that are fixed to it.

    Example: wingfit forces flight.csv --body body.csv --mass-kg 0.0174 --flap-hz 12.5 -o forces.csv --plot forces.html
    """
    from wingfit.cli.forces import free_flight_results as results  # imported late: other commands start faster

    with refused("no forces were estimated"):
        low_pass = results.LowPass(cutoff_hz or results.CUTOFF_PER_BEAT * flap_hz, order)
        flight = results.read_flight(tracks, body, mass_kg, low_pass, inertia)
        recording = results.recording(
            flight,
            (output or tracks).stem,
            flap_hz,
            beat_start_s or 0.0,
            results.PASCAL_PER_MBAR * pressure_mbar,
            results.ZERO_CELSIUS + temperature_c,
        )
    results.write(flight, recording, output, details)
    if plot:
        results.write_plot(flight, plot, f"Forces in free flight, {tracks.name}")
    results.report(flight)
    results.entry(recording, starts_at_beat=beat_start_s is not None)
    next_step("put the recording into a dataset, then: wingfit datasets check FOLDER")
