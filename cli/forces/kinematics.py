"""``wingfit kinematics``: computes the motion of a wing from measured angles or tracked markers, without a server."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

import typer

from wingfit.cli.base.files import new_file, refused
from wingfit.cli.base.output import next_step

Wing = Literal["upper-right", "upper-left", "lower-right", "lower-left"]


def kinematics(
    file: Annotated[Path, typer.Argument(help="CSV: time_s or t_star, and angles in degrees or markers in metres.")],
    output: Annotated[Path | None, new_file("Write the motion for dataset.yaml.", "--output", "-o")] = None,
    plot: Annotated[Path | None, new_file("Plot angles, rates and their errors: FILE.html.", "--plot")] = None,
    leading_edge: Annotated[str, typer.Option(help="Markers on the leading edge from root to tip: A,B,...")] = "",
    chord: Annotated[str, typer.Option(help="Markers along one chord from leading to trailing edge: C,D.")] = "",
    wing: Annotated[Wing, typer.Option(help="Wing that carries the markers.")] = "upper-right",
    dihedral_deg: Annotated[
        float | None,
        typer.Option(help="Closed wings above the horizontal; markers only; default: smallest angle is 0."),
    ] = None,
    hinge_m: Annotated[str, typer.Option(help="Y,Z of the flapping axis in body axes, m; markers only.")] = "",
    flap_hz: Annotated[float | None, typer.Option(help="Flap frequency; default: estimated.")] = None,
    harmonics: Annotated[
        int | None, typer.Option(help="Harmonics of the Fourier series; default: chosen by cross-validation.")
    ] = None,
    pitch: Annotated[
        Literal["fourier", "passive"],
        typer.Option(help="Wing pitch as a Fourier series, or by Eq. 17 (Armanini 2016)."),
    ] = "fourier",
    pitch_station: Annotated[float, typer.Option(help="Span fraction at which the pitch was measured.")] = 0.7,
    root_pitch_deg: Annotated[float, typer.Option(help="Pitch at the flapping axis; 90: chord along the body.")] = 90.0,
    peel_end_beats: Annotated[float, typer.Option(help="Time of full separation of the wings.")] = 0.17,
    start_s: Annotated[
        float | None, typer.Option(help="A start of a beat; default: estimated (wings closest).")
    ] = None,
) -> None:
    """Estimate the motion of a vehicle's wings from measured wing angles or marker tracks, with its errors.

    A table has the columns time_s (or t_star), flap_angle_deg, wing_pitch_deg; tracks have MARKER_x_m, _y_m, _z_m in
    body axes (x to the nose, y right, z down). Noise can be separated from motion only with several beats.

    Example: wingfit kinematics angles.csv --pitch passive -o motion.yaml --plot motion.html
    """
    from wingfit.cli.forces import kinematics_results as results  # imported late: other commands start faster

    with refused("no motion was estimated"):
        data = results.read_data(file, leading_edge, chord)
        angles, start = results.read_angles(data, leading_edge, chord, wing, dihedral_deg, hinge_m, flap_hz)
        motion = results.wing_motion(
            angles,
            flap_hz,
            harmonics,
            pitch,
            pitch_station,
            math.radians(root_pitch_deg),
            peel_end_beats,
            start_s if start_s is not None else start,
            None if leading_edge and dihedral_deg is None else 0.0,
        )
    if output:
        results.write_motion(motion, output)
    if plot:
        results.write_plot(motion, plot, f"Motion of the wing, {file.name}")
    results.report(motion)
    next_step("put the motion into dataset.yaml, then: wingfit datasets check FOLDER")
