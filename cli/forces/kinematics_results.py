"""Computes, prints and writes the results of ``wingfit kinematics``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import typer

from wingfit.cli.base.files import read_bytes, write_text
from wingfit.cli.base.output import note, number, say, table
from wingfit.records.description.convert import to_data
from wingfit.records.description.vehicle_file import MotionFile
from wingfit.records.description.yaml_text import write_yaml
from wingfit.records.files.number_table import Table, header_of, read_table, require
from wingfit.report.charts import Chart, Curve, chart_page
from wingfit.tracking.smoothing import PeriodicFit
from wingfit.tracking.wing_kinematics import Angles, WingKinematics, WingPlace, beats_of, from_markers, wing_motion

SMALLEST_RANGE_DEG = 2.0  # of a plausible flap angle in degrees: a range below is probably in radians
ORDERS = ("", "/s", "/s²", "/s³")


__all__ = ["wing_motion"]


def read_data(file: Path, leading_edge: str, chord: str) -> Table:
    """Return the table in the CSV ``file``; raise an error if columns are missing.

    ``leading_edge``, ``chord``: comma-separated names of markers, whose columns are then needed instead of angles.
    """
    raw = read_bytes(file)
    _check_columns(header_of(raw, file.name), file.name, f"{leading_edge},{chord}" if leading_edge else "")
    return read_table(raw, file.name)


def write_motion(motion: WingKinematics, path: Path) -> None:
    """Write the ``motion:`` entry of dataset.yaml to ``path``."""
    write_text(path, write_yaml({"motion": to_data(motion.motion, MotionFile)}), "motion")
    note("put it under vehicle:, or under a recording, of dataset.yaml")


def _check_columns(header: list[str], file: str, markers: str) -> None:
    """Raise an error that names all columns missing in ``header``; ``markers``: comma-separated, "" for angles."""
    if len(header) < 2:
        return  # read_table reports the wrong separator or the empty file
    if not markers and "flap_angle_deg" not in header and any(name.endswith("_x_m") for name in header):
        raise ValueError("the file holds markers; name those to use: --leading-edge A,B and --chord C,D")
    times = "t_star" if "t_star" in header and "time_s" not in header else "time_s"
    names = [name.strip() for name in markers.split(",") if name.strip()]
    angles = [f"{name}_{axis}_m" for name in names for axis in "xyz"] or ["flap_angle_deg", "wing_pitch_deg"]
    require(header, [times, *angles], file)


def read_angles(
    data: Table,
    leading_edge: str,
    chord: str,
    wing: str,
    dihedral_deg: float | None,
    hinge_m: str,
    flap_hz: float | None,
) -> tuple[Angles, float | None]:
    """Return the wing angles in ``data``, and the time (s) of the start of a beat: 0 for times t_star, else None.

    ``leading_edge``, ``chord``: comma-separated markers from which the angles are computed; "": the table has angles.
    ``wing``: e.g. "upper-right"; ``dihedral_deg``: angle of the closed wings above the horizontal, None if unknown;
    ``hinge_m``: "Y,Z" of the flapping axis in body axes (m) or ""; ``flap_hz``: needed for times t_star.
    """
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
    """Return a remark if the range of the angle ``flap`` [N] (deg) is so small that it may be in radians; else ()."""
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


def report(motion: WingKinematics) -> None:
    """Print the errors of the angles and their derivatives, the flap frequency, the start of a beat, and Eq. 17."""
    rows = [row for name, fit in _fits(motion) for row in _quality(name, fit)]
    table(["over the beat", ">RMS deg", ">noise", ">truncation, at most", ">error / RMS"], rows)
    error = motion.frequency.error
    known = f" +/- {number(error, 2)}" if error is not None else ""
    say(f"flap frequency {number(motion.frequency.hertz, 6)}{known} Hz")
    say(f"a beat starts at time_s {motion.start:.5f} +/- {number(motion.start_error, 2)} s (wings closest, opening)")
    for name, fit in _fits(motion):
        chosen = "chosen by cross-validation" if fit.scores else "as given"
        cutoff = number(fit.harmonics * fit.frequency, 3)
        size = number(float(np.degrees(fit.noise.deviation)), 2)
        say(f"{name}: {fit.harmonics} harmonics ({chosen}), up to {cutoff} Hz; noise of one sample: {size} deg")
    if motion.law:
        law, names = motion.law, ("constant_rad", "flap", "flap_rate_s", "flap_rate_squared_s2")
        values = (law.pitch.constant, law.pitch.flap, law.pitch.flap_rate, law.pitch.flap_rate_squared)
        for name, value, deviation in zip(names, values, law.errors, strict=True):
            say(f"Eq. 17, {name}: {number(value)} +/- {number(float(deviation), 2)}")
        say(f"RMS difference of Eq. 17 from the pitch: {number(float(np.degrees(law.misfit)), 3)} deg")
    for remark in motion.remarks:
        say(f"note: {remark}")


def _fits(motion: WingKinematics) -> list[tuple[str, PeriodicFit]]:
    return [("flap angle", motion.flap), ("wing pitch", motion.pitch)]


def _quality(name: str, fit: PeriodicFit) -> list[list[str]]:
    rows = []
    for d in range(3):
        size, noise, lost = (float(np.degrees(values[d])) for values in (fit.amplitude, fit.passed, fit.lost))
        share = f"{100 * float(np.hypot(noise, lost)) / size:.2g} %" if size > 0 else "–"
        rows.append(
            [f"{name}{', deg' + ORDERS[d] if d else ''}", number(size), number(noise, 2), number(lost, 2), share]
        )
    return rows


def write_plot(motion: WingKinematics, path: Path, title: str) -> None:
    """Write an HTML page that plots angles, with samples, rates and accelerations, with two standard errors."""
    phase, charts = np.arange(361) / 360, []
    for d in range(3):
        for (name, fit), samples in zip(_fits(motion), (motion.angles.flap, motion.angles.pitch), strict=True):
            middle, error = (np.degrees(values) for values in (fit.at(phase, d), 2 * fit.error_at(phase, d)))
            curves = [
                Curve("2 standard errors", phase, middle, band=(middle - error, middle + error)),
                Curve("Fourier series", phase, middle),
            ]
            if d == 0 and samples is not None:
                folded = ((motion.angles.times - fit.start) * fit.frequency) % 1.0
                curves.insert(0, Curve("measured", folded, np.degrees(samples), dots=True))
            charts.append(Chart(f"{name}, deg{ORDERS[d]}", "t*", f"deg{ORDERS[d]}", curves))
    write_text(path, chart_page(title, charts), "plots")
