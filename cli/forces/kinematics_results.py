"""What ``wingfit kinematics`` computes, prints, writes and draws."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import typer

from wingfit.cli.base.files import write_text
from wingfit.cli.base.output import note, number, say, table
from wingfit.cli.loads import COLOURS
from wingfit.client.client import WingfitError
from wingfit.records import DatasetError
from wingfit.records.description.convert import to_data
from wingfit.records.description.vehicle_file import MotionFile
from wingfit.records.description.yaml_text import write_yaml
from wingfit.tracking.smoothing import PeriodicFit
from wingfit.tracking.tables import Table, header_of, read_table, require
from wingfit.tracking.wing_kinematics import Angles, WingKinematics, WingPlace, beats_of, from_markers, wing_motion

SMALLEST_RANGE_DEG = 2.0  # of a flap angle that needs no remark: 2 rad would be 115 deg
ORDERS = ("", "/s", "/s²", "/s³")


@dataclass(frozen=True)
class Wanted:
    """The options of ``wingfit kinematics``."""

    file: Path
    output: Path | None
    plot: Path | None
    leading_edge: str
    chord: str
    wing: str
    dihedral_deg: float | None
    hinge_m: str
    flap_hz: float | None
    harmonics: int | None
    pitch: Literal["fourier", "passive"]
    pitch_station: float
    root_pitch_deg: float
    peel_end_beats: float
    start_s: float | None


def estimate(wanted: Wanted) -> None:
    """Estimate the motion, print how well it is known, and write what is wanted; WingfitError where it fails."""
    try:
        raw = _bytes(wanted.file)
        _check_columns(
            header_of(raw, wanted.file.name),
            wanted.file.name,
            f"{wanted.leading_edge},{wanted.chord}" if wanted.leading_edge else "",
        )
        data = read_table(raw, wanted.file.name)
        angles, start = _angles(
            data, wanted.leading_edge, wanted.chord, wanted.wing, wanted.dihedral_deg, wanted.hinge_m, wanted.flap_hz
        )
        found = wing_motion(
            angles,
            wanted.flap_hz,
            wanted.harmonics,
            wanted.pitch,
            wanted.pitch_station,
            np.radians(wanted.root_pitch_deg),
            wanted.peel_end_beats,
            wanted.start_s if wanted.start_s is not None else start,
            None if wanted.leading_edge and wanted.dihedral_deg is None else 0.0,
        )
    except (DatasetError, ValueError) as error:
        raise WingfitError("no motion found", str(error)) from error
    if wanted.output:
        write_text(wanted.output, write_yaml({"motion": to_data(found.motion, MotionFile)}))
        note(f"motion written to {wanted.output}; it goes under vehicle: or under a recording of dataset.yaml")
    if wanted.plot:
        write_text(wanted.plot, _page(found, f"Motion of the wing, {wanted.file.name}"))
        note(f"plots written to {wanted.plot}; open it in a browser")
    _report(found)


def _bytes(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise WingfitError(f"cannot read {file}", error.strerror or str(error)) from error


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
