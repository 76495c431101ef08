"""Forces from tables: units, axes and signs, wind axes, times, and what is refused."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

from tests.command_line import Wingfit, in_process
from tests.importers.forces.balance_files import BODY, DOWN, FORE, RATE, TIMES, agrees, read, refused, table
from wingfit.cli.importing.forces import import_forces as command
from wingfit.importers.forces.channels import FORCE_UNITS, force_unit, role_of
from wingfit.records.files.forces import read_forces

SIDE = np.full(40, 0.05)
PLAIN = table("time_s,Fx_N,Fy_N,Fz_N", TIMES, FORE, SIDE, DOWN)


def test_a_table_in_body_axes(tmp_path: Path) -> None:
    found = read(tmp_path, PLAIN, **BODY)
    assert agrees(found)
    assert np.allclose(found.times, TIMES)
    assert {(one.fact, one.by) for one in found.statements} >= {("unit of Fx_N", "file"), ("axes", "user")}
    assert any("side force is not imported" in one for one in found.remarks)
    assert any("--start-s" in one for one in found.remarks)
    samples = read_forces(found.csv().encode(), "run.csv")
    assert samples.forces == ("x", "z")
    assert np.allclose(samples.values, found.forces, atol=1e-12)


@pytest.mark.parametrize("unit", FORCE_UNITS)
def test_units(tmp_path: Path, unit: str) -> None:
    newtons = {"N": 1.0, "mN": 1e-3, "uN": 1e-6, "kN": 1e3, "gf": 9.80665e-3, "kgf": 9.80665, "lbf": 4.4482216152605}
    scaled = (FORE / newtons[unit], SIDE / newtons[unit], DOWN / newtons[unit])
    assert agrees(read(tmp_path, table(f"t (s),Fx ({unit}),Fy ({unit}),Fz ({unit})", TIMES, *scaled), **BODY))
    assert agrees(read(tmp_path, table("t (s),Fx,Fy,Fz", TIMES, *scaled), unit=unit, **BODY))
    assert agrees(read(tmp_path, table(f"time,Fx,Fy,Fz\ns,{unit},{unit},{unit}", TIMES, *scaled), **BODY))


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("Fx", "fx"),
        ("force_z_mN", "fz"),
        ("Force Z [mN]", "fz"),
        ("F_y", "fy"),
        ("Lift (gf)", "lift"),
        ("lift/N", "lift"),
        ("Fz(N)", "fz"),
        ("DRAG_N", "drag"),
    ],
)
def test_names(name: str, role: str) -> None:
    found = role_of(name)
    assert found is not None
    assert found[0] == role
    assert not found[1] or force_unit(found[1])


@pytest.mark.parametrize("name", ["Mx", "Tz", "torque_x", "flow", "frame", "lifting", "foo_x", "x", "F"])
def test_other_names_are_no_forces(name: str) -> None:
    assert role_of(name) is None


def test_signs_follow_the_stated_directions(tmp_path: Path) -> None:
    text = table("time_s,Fx_N,Fy_N,Fz_N", TIMES, -DOWN, -FORE, SIDE)  # x up, y aft, z left
    assert agrees(read(tmp_path, text, axes="x up, y aft, z left", balance="body"))


@pytest.mark.parametrize("pitch", [0.0, 31.0, 90.0])
def test_wind_axes_are_turned_by_the_body_pitch(tmp_path: Path, pitch: float) -> None:
    theta = math.radians(pitch)
    # Eq. 16 of Armanini et al. 2016 solved for X and Z: X = L sin - D cos, Z = -L cos - D sin
    lift, drag = FORE * np.sin(theta) - DOWN * np.cos(theta), -FORE * np.cos(theta) - DOWN * np.sin(theta)
    named = read(tmp_path, table("time_s,Lift_N,Drag_N", TIMES, lift, drag), body_pitch_deg=pitch)
    assert agrees(named)
    thrust = read(tmp_path, table("time_s,lift_N,thrust_N", TIMES, lift, -drag), body_pitch_deg=pitch, balance="wind")
    assert agrees(thrust)
    axes: dict[str, Any] = {"axes": "x nose, y right, z down", "balance": "wind", "body_pitch_deg": pitch}
    assert agrees(read(tmp_path, table("time_s,Fx_N,Fz_N", TIMES, -drag, -lift), **axes))


def test_thrust_and_lift_of_a_balance_that_turns_with_the_body(tmp_path: Path) -> None:
    text = table("time_s,thrust_mN,lift_mN", TIMES, 1e3 * FORE, -1e3 * DOWN)
    assert "turns with the body" in refused(tmp_path, text)
    assert agrees(read(tmp_path, text, balance="body"))


def test_one_axis_is_enough_in_body_axes(tmp_path: Path) -> None:
    found = read(tmp_path, table("time_s,Fz_N", TIMES, DOWN), **BODY)
    assert found.axes == ("z",)
    assert np.allclose(found.forces[:, 0], DOWN)
    assert found.csv().startswith("time_s,force_z_n\n")


def test_lines_above_the_header_other_columns_and_columns_by_option(tmp_path: Path) -> None:
    text = "Balance 7\nCalibrated 2024\n\n" + table(
        "clock\tch1\tch2\tTemp", 1e3 * TIMES, FORE, DOWN, TIMES, separator="\t"
    )
    options: dict[str, Any] = {"columns": "time=clock; fx=ch1; fz=ch2", "time_unit": "ms", "unit": "N", **BODY}
    found = read(tmp_path, text, **options)
    assert agrees(found)
    assert "not imported: Temp" in found.remarks
    assert "3 lines above the header are not read" in found.remarks
    assert "did you mean 'ch2'" in refused(tmp_path, text, **{**options, "columns": "fx=ch1; fz=ch2x"})
    assert "is none of time, fx" in refused(tmp_path, text, **{**options, "columns": "mx=ch1"})


def test_a_rate_gaps_the_start_of_a_beat_and_decimal_commas(tmp_path: Path) -> None:
    rows = [f"{fore:.6f};{down:.6f}".replace(".", ",") for fore, down in zip(FORE, DOWN, strict=True)]
    rows[5] = ";" + rows[5].partition(";")[2]
    text = "\n".join(["Fx [N];Fz [N]", *rows]) + "\n"
    found = read(tmp_path, text, rate_hz=RATE, decimal="comma", start_s=0.01, **BODY)
    assert math.isclose(found.times[0], -0.01)
    assert np.isnan(found.forces).sum() == 1
    assert found.summary()[0]["gaps"] == 1
    assert np.allclose(found.forces[6:], np.column_stack([FORE, DOWN])[6:], atol=1e-6)
    assert "--decimal comma" in refused(tmp_path, text, rate_hz=RATE, **BODY)


def test_all_that_is_missing_is_listed_at_once(tmp_path: Path) -> None:
    message = refused(tmp_path, table("Fx,Fz", FORE, DOWN))
    for words in ("--unit N", "--rate-hz", "--balance body", "--axes 'x nose, y right, z down'", "samples per second"):
        assert words in message
    assert "--body-pitch-deg" in refused(tmp_path, table("time_s,lift_N,drag_N", TIMES, -DOWN, -FORE))


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        (PLAIN, {**BODY, "unit": "mN"}, "but run.csv states N"),
        (PLAIN, {**BODY, "body_pitch_deg": 5.0}, "not needed for a balance in body axes"),
        (PLAIN, {"axes": "x aft, y out, z up", "balance": "body"}, "use right or left"),
        (PLAIN, {**BODY, "unit": "pounds"}, "must be one of N, mN"),
        (PLAIN, {**BODY, "rate_hz": 400.0}, "is 400 Hz, but run.csv states 500 Hz"),
        (PLAIN, {"axes": BODY["axes"], "balance": "wind", "body_pitch_deg": 400.0}, "[-180, 180] deg"),
        (table("time_s,Fx_g,Fz_g", TIMES, FORE, DOWN), BODY, "it is a unit of mass: if gram-force is meant, --unit gf"),
        (table("time_s,Fx_MN,Fz_MN", TIMES, FORE, DOWN), BODY, "no unit of force"),
        (table("time_s,lift_N,drag_N,Fx_N", TIMES, FORE, DOWN, DOWN), BODY, "choose one kind"),
        (table("time_s,thrust_N,drag_N", TIMES, FORE, DOWN), {}, "which are opposite"),
        (table("time_s,lift_N,drag_N", TIMES, FORE, DOWN), {"balance": "body", "body_pitch_deg": 3.0}, "are wind axes"),
        (table("time_s,lift_N", TIMES, FORE), {"body_pitch_deg": 3.0}, "no force along the stream"),
        (table("time_s,Fy_N", TIMES, SIDE), BODY, "no force along the body"),
        (table("time_s,Fx_N,Fx_mN", TIMES, FORE, FORE), BODY, "second column of fx"),
        (table("time_s,Fx_N", TIMES[:5], FORE[:5]), BODY, "at least 8 are needed"),
        (table("time_s,Fx_N", TIMES**2, FORE), BODY, "even steps within 1 %"),
        (table("time,Fx_N", TIMES, FORE), BODY, "--time-unit"),
        (table("time_s,Mx,Mz", TIMES, FORE, DOWN), BODY, "names a force"),
        (PLAIN.replace("0.05,", "0,05,", 1), BODY, "has 5 cells where the header has 4"),
        (PLAIN.replace("0.05", "volt", 1), BODY, "is 'volt'; it must be a number"),
        (PLAIN.replace("0.05", "1e300", 1), BODY, "line 2, column 'Fy_N': is 1e+300 N; at most 100000 N are plausible"),
        (table("time_s,Fx_N,Fz_N", TIMES, 0 * FORE, 0 * DOWN), BODY, "all forces are exactly 0 N"),
        (PLAIN, {**BODY, "start_s": 99.0}, "--start-s: is 99 s; it must lie in [0, 0.078] s"),
        (PLAIN, {**BODY, "columns": "fx=Fx"}, "'Fx': did you mean 'Fx_N'"),
        (bytes(range(256)) * 4, BODY, "is binary and no TDMS"),
        (b"", BODY, "is empty"),
    ],
)
def test_what_is_refused(tmp_path: Path, text: str | bytes, options: dict[str, Any], words: str) -> None:
    assert words in refused(tmp_path, text, **options)


@pytest.fixture
def wingfit() -> Wingfit:
    app = typer.Typer()
    app.command()(command)

    return in_process(app)


def test_the_command(wingfit: Wingfit, tmp_path: Path) -> None:
    source, target = tmp_path / "run.csv", tmp_path / "out.csv"
    source.write_text(PLAIN)
    stated = ("--axes", "x nose, y right, z down", "--balance", "body")
    code, out, err = wingfit(source, *stated)
    assert code == 0, err
    assert "run.csv: table, 40 samples" in out
    assert "z, down" in out
    assert "nothing was written" in err
    code, out, _ = wingfit(source, *stated, "-o", target, "--json")
    assert code == 0
    assert json.loads(out)["written"] == str(target)
    assert math.isclose(json.loads(out)["forces"][1]["mean_n"], float(DOWN.mean()))
    assert wingfit(source, *stated, "-o", target)[0] == 2
    assert wingfit(source, *stated, "-o", source, "--force")[0] == 2
    code, _, message = wingfit(source)
    assert code == 1
    assert "2 errors" in message
