"""``wingfit kinematics``: the motion of a wing from measured angles or tracked markers. Needs no server."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer

from wingfit.cli.loads import COLOURS, check_file
from wingfit.cli.output import note, number, say, table
from wingfit.client.client import WingfitError
from wingfit.records import Condition, DatasetError, Recording, WingMotion
from wingfit.records.description.convert_vehicle import describe_recording
from wingfit.records.description.yaml_text import write_yaml
from wingfit.tracking.smoothing import PeriodicFit
from wingfit.tracking.tables import Table, header_of, read_table, require
from wingfit.tracking.wing_kinematics import Angles, WingKinematics, WingPlace, beats_of, from_markers, wing_motion

Wing = Literal["upper-right", "upper-left", "lower-right", "lower-left"]
SMALLEST_RANGE_DEG = 2.0  # of a flap angle that needs no remark: 2 rad would be 115 deg
ORDERS = ("", "/s", "/s²", "/s³")


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
    try:
        raw = _bytes(file)
        _check_columns(header_of(raw, file.name), file.name, f"{leading_edge},{chord}" if leading_edge else "")
        data = read_table(raw, file.name)
        angles, start = _angles(data, leading_edge, chord, wing, dihedral_deg, hinge_m, flap_hz)
        found = wing_motion(
            angles,
            flap_hz,
            harmonics,
            pitch,
            pitch_station,
            np.radians(root_pitch_deg),
            peel_end_beats,
            start_s if start_s is not None else start,
            None if leading_edge and dihedral_deg is None else 0.0,
        )
    except (DatasetError, ValueError) as error:
        raise WingfitError("no motion found", str(error)) from error
    if output:
        _write(output, write_yaml({"motion": motion_data(found.motion, found.frequency.hertz)}))
        note(f"motion written to {output}; it goes under vehicle: or under a recording of dataset.yaml")
    if plot:
        _write(plot, _page(found, f"Motion of the wing, {file.name}"))
        note(f"plots written to {plot}; open it in a browser")
    _report(found)


def motion_data(motion: WingMotion, flap_frequency: float) -> Any:
    """``motion`` as the plain data of ``dataset.yaml``."""
    condition = Condition(flap_frequency, 0.0, 101325.0, 293.15)
    bare = Recording("motion", "wind_tunnel", condition, np.empty(0), (), np.empty((0, 0)), motion=motion)
    return describe_recording(bare)["motion"]


def _bytes(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise WingfitError(f"cannot read {file}", error.strerror or str(error)) from error


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise WingfitError(f"cannot write {path}", error.strerror or str(error)) from error


def _check_columns(header: list[str], file: str, markers: str) -> None:
    """Name all columns that are missing before any number is read."""
    if len(header) < 2:
        return  # read_table tells the separator or an empty file
    if not markers and "flap_angle_deg" not in header and any(name.endswith("_x_m") for name in header):
        raise ValueError("the file holds markers; say which: --leading-edge A,B and --chord C,D")
    times = "t_star" if "t_star" in header and "time_s" not in header else "time_s"
    names = [name.strip() for name in markers.split(",") if name.strip()]
    angles = [f"{name}_{axis}_m" for name in names for axis in "xyz"] or ["flap_angle_deg", "wing_pitch_deg"]
    require(header, [times, *angles], file)


def _angles(
    data: Table,
    leading_edge: str,
    chord: str,
    wing: str,
    dihedral_deg: float | None,
    hinge_m: str,
    flap_hz: float | None,
) -> tuple[Angles, float | None]:
    """The angles that the file holds, and the start of a beat where its times say so."""
    times, start = _times(data, flap_hz)
    if not leading_edge:
        flap, pitch = data.column("flap_angle_deg"), data.column("wing_pitch_deg")
        return Angles(times, np.radians(flap), np.radians(pitch), _small(flap)), start
    place = WingPlace(
        wing.startswith("upper"), wing.endswith("right"), None if dihedral_deg is None else np.radians(dihedral_deg)
    )
    edge = _tracks(data, leading_edge)
    along = _tracks(data, chord) if chord else None
    return from_markers(times, edge, along, place, _pair(hinge_m) if hinge_m else None), start


def _small(flap: np.ndarray[Any, np.dtype[np.float64]]) -> tuple[str, ...]:
    """A remark where the flap angle, deg, hardly moves: it may be in radians."""
    seen = flap[np.isfinite(flap)]
    size = float(np.ptp(seen)) if len(seen) else np.inf
    if size >= SMALLEST_RANGE_DEG:
        return ()
    return (f"flap_angle_deg ranges over {number(size, 2)} deg only; if these are radians, convert to degrees",)


def _times(data: Table, flap_hz: float | None) -> tuple[np.ndarray[Any, np.dtype[np.float64]], float | None]:
    if "time_s" in data.columns or "t_star" not in data.columns:
        return data.times(), None
    if flap_hz is None:
        raise typer.BadParameter("the times are t_star; give the flap frequency in Hz", param_hint="--flap-hz")
    return beats_of(data.column("t_star")) / flap_hz, 0.0


def _tracks(data: Table, names: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.stack([data.track(name.strip()) for name in names.split(",")], axis=1)


def _pair(text: str) -> tuple[float, float]:
    try:
        y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(
            f"{text}: give two numbers in metres, such as 0.01,-0.005", param_hint="--hinge-m"
        ) from None
    return y, z


def _report(found: WingKinematics) -> None:
    rows = [row for name, fit in _fits(found) for row in _quality(name, fit)]
    table(["over the beat", ">RMS deg", ">noise", ">cut off, up to", ">of the RMS"], rows)
    error = found.frequency.error
    known = f" +/- {number(error, 2)}" if error is not None else ""
    say(f"flap frequency {number(found.frequency.hertz, 6)}{known} Hz")
    say(f"a beat starts at time_s {found.start:.5f} +/- {number(found.start_error, 2)} s (wings closest, opening)")
    for name, fit in _fits(found):
        chosen = "chosen by cross-validation" if fit.scores else "as given"
        cutoff = number(fit.harmonics * fit.frequency, 3)
        size = number(float(np.degrees(fit.noise.deviation)), 2)
        say(f"{name}: {fit.harmonics} harmonics ({chosen}), up to {cutoff} Hz; a sample's noise is {size} deg")
    if found.law:
        law, names = found.law, ("constant_rad", "flap", "flap_rate_s", "flap_rate_squared_s2")
        values = (law.pitch.constant, law.pitch.flap, law.pitch.flap_rate, law.pitch.flap_rate_squared)
        for name, value, deviation in zip(names, values, law.errors, strict=True):
            say(f"Eq. 17, {name}: {number(value)} +/- {number(float(deviation), 2)}")
        say(f"Eq. 17 differs from the pitch by {number(float(np.degrees(law.misfit)), 3)} deg RMS")
    for remark in found.remarks:
        say(f"note: {remark}")


def _fits(found: WingKinematics) -> list[tuple[str, PeriodicFit]]:
    return [("flap angle", found.flap), ("wing pitch", found.pitch)]


def _quality(name: str, fit: PeriodicFit) -> list[list[str]]:
    rows = []
    for d in range(3):
        size, noise, lost = (float(np.degrees(values[d])) for values in (fit.amplitude, fit.passed, fit.lost))
        share = f"{100 * float(np.hypot(noise, lost)) / size:.2g} %" if size > 0 else "–"
        rows.append(
            [f"{name}{', deg' + ORDERS[d] if d else ''}", number(size), number(noise, 2), number(lost, 2), share]
        )
    return rows


def _page(found: WingKinematics, title: str) -> str:
    """A page that needs nothing else: angles with their samples, rates and accelerations with their errors."""
    from plotly import graph_objects
    from plotly.subplots import make_subplots

    fits, phase = _fits(found), np.arange(361) / 360
    measured = (found.angles.flap, found.angles.pitch)
    heads = [f"{name}, deg{ORDERS[d]}" for d in range(3) for name, _ in fits]
    figure = make_subplots(rows=3, cols=len(fits), shared_xaxes=True, subplot_titles=heads, vertical_spacing=0.06)
    for column, (_, fit) in enumerate(fits, 1):
        samples = measured[column - 1]
        folded = ((found.angles.times - fit.start) * fit.frequency) % 1.0
        figure.add_trace(
            graph_objects.Scattergl(
                x=folded,
                y=None if samples is None else np.degrees(samples),
                mode="markers",
                name="measured",
                marker={"size": 3, "color": "#999999"},
            ),
            row=1,
            col=column,
        )
        for d in range(3):
            middle, error = fit.at(phase, d), 2 * fit.error_at(phase, d)
            band = np.degrees(np.concatenate([middle + error, (middle - error)[::-1]]))
            around = graph_objects.Scatter(
                x=np.concatenate([phase, phase[::-1]]), y=band, fill="toself", mode="none", name="2 standard errors"
            )
            figure.add_trace(around, row=d + 1, col=column)
            line = {"width": 2, "color": COLOURS[column - 1]}
            figure.add_trace(
                graph_objects.Scatter(x=phase, y=np.degrees(middle), name="series", line=line), row=d + 1, col=column
            )
        figure.update_xaxes(title_text="t*", row=3, col=column)
    figure.update_layout(title=title, height=900, template="plotly_white", showlegend=False)
    return str(figure.to_html(include_plotlyjs=True))
