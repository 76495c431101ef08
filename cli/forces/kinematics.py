"""``wingfit kinematics``: the motion of a wing from measured angles or tracked markers. Needs no server."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from wingfit.cli.base.files import check_file

Wing = Literal["upper-right", "upper-left", "lower-right", "lower-left"]


def kinematics(
    file: Annotated[Path, typer.Argument(help="CSV: time_s or t_star, and angles in degrees or markers in metres.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write motion: of dataset.yaml.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw angles, rates and their errors: FILE.html.")] = None,
    leading_edge: Annotated[str, typer.Option(help="Markers on the leading edge from root to tip: A,B,...")] = "",
    chord: Annotated[str, typer.Option(help="Markers along one chord from leading to trailing edge: C,D.")] = "",
    wing: Annotated[Wing, typer.Option(help="Which wing the markers sit on.")] = "upper-right",
    dihedral_deg: Annotated[
        float | None, typer.Option(help="Closed wings above the horizontal; markers only. Else: smallest angle is 0.")
    ] = None,
    hinge_m: Annotated[str, typer.Option(help="Y,Z of the flapping axis in body axes, m; markers only.")] = "",
    flap_hz: Annotated[float | None, typer.Option(help="Flap frequency; found if left out.")] = None,
    harmonics: Annotated[
        int | None, typer.Option(help="Of the series; chosen by cross-validation if left out.")
    ] = None,
    pitch: Annotated[
        Literal["fourier", "passive"], typer.Option(help="Wing pitch as a series, or as the law of Eq. 17.")
    ] = "fourier",
    pitch_station: Annotated[float, typer.Option(help="Span fraction at which the pitch was measured.")] = 0.7,
    root_pitch_deg: Annotated[float, typer.Option(help="Pitch at the flapping axis; 90: chord along the body.")] = 90.0,
    peel_end_beats: Annotated[float, typer.Option(help="When the whole chord has come apart.")] = 0.17,
    start_s: Annotated[float | None, typer.Option(help="A start of a beat; found if left out (wings closest).")] = None,
) -> None:
    """Turn measured wing angles or marker tracks into the motion of a vehicle's wings, and say how well it is known.

    A table has the columns time_s (or t_star), flap_angle_deg, wing_pitch_deg; tracks have MARKER_x_m, _y_m, _z_m in
    body axes (x to the nose, y right, z down). Several beats tell noise from motion.

    Example: wingfit kinematics angles.csv --pitch passive -o motion.yaml --plot motion.html
    """
    check_file(output, "--output")
    check_file(plot, "--plot", (".html",))
    from wingfit.cli.forces.kinematics_results import Wanted, estimate  # what computes waits until it is needed

    estimate(
        Wanted(
            file, output, plot, leading_edge, chord, wing, dihedral_deg, hinge_m, flap_hz, harmonics, pitch,
            pitch_station, root_pitch_deg, peel_end_beats, start_s,
        )
    )  # fmt: skip
