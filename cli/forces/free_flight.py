"""``wingfit forces``: forces on a freely flying vehicle from its tracked markers. Needs no server."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wingfit.cli.base.files import check_file


def forces(
    tracks: Annotated[Path, typer.Argument(help="CSV: time_s, MARKER_x_m, _y_m, _z_m of a frame with z up.")],
    body: Annotated[
        Path, typer.Option(help="CSV: marker,x_m,y_m,z_m in body axes (x to the nose, z down); a row centre_of_mass.")
    ],
    mass_kg: Annotated[float, typer.Option(help="Of the whole vehicle.", min=1e-6, max=100)],
    flap_hz: Annotated[float, typer.Option(help="Flap frequency.", min=0.01, max=2000)],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write the recording: FILE.csv.")] = None,
    details: Annotated[
        Path | None,
        typer.Option(help="Write all forces and moments with standard deviations, and the flight: FILE.csv."),
    ] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw forces with their errors: FILE.html.")] = None,
    cutoff_hz: Annotated[float | None, typer.Option(help="Of the low-pass; default: 3.2 x flap frequency.")] = None,
    order: Annotated[int, typer.Option(help="Of one pass of the Butterworth filter.", min=1, max=8)] = 4,
    beat_start_s: Annotated[
        float | None, typer.Option(help="A time at which a beat starts; 'wingfit kinematics' finds one.")
    ] = None,
    inertia: Annotated[str, typer.Option(help="Ixx,Iyy,Izz,Ixz about the centre of mass, kg m^2: adds moments.")] = "",
    pressure_mbar: Annotated[float, typer.Option(help="Of the air.", min=1, max=2000)] = 1013.25,
    temperature_c: Annotated[float, typer.Option(help="Of the air.", min=-100, max=100)] = 20.0,
) -> None:
    """Find the forces on a vehicle in free flight from its tracked markers: F = m (a - g) in body axes.

    Prints how well they are known, and the entry of the recording for dataset.yaml. The vehicle counts as one rigid
    body; name only markers that do not move on it.

    Example: wingfit forces flight.csv --body body.csv --mass-kg 0.0174 --flap-hz 12.5 -o forces.csv --plot forces.html
    """
    for path, option, kind in ((output, "--output", ".csv"), (details, "--details", ".csv"), (plot, "--plot", ".html")):
        check_file(path, option, (kind,))
    from wingfit.cli.forces.free_flight_results import Wanted, estimate  # what computes waits until it is needed

    estimate(
        Wanted(
            tracks, body, mass_kg, flap_hz, output, details, plot, cutoff_hz, order, beat_start_s, inertia,
            pressure_mbar, temperature_c,
        )
    )  # fmt: skip
