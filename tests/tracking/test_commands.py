"""``wingfit kinematics`` and ``wingfit forces`` as a user types them, without a server."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import typer

from tests.command_line import Wingfit, in_process
from tests.oracles.wing_kinematics import noise, passive_pitch, split_cycle, wing_markers
from tests.tracking.test_free_flight import CENTRE, MARKERS, pitched, seen_from, times
from wingfit.cli.forces.free_flight import forces
from wingfit.cli.forces.kinematics import kinematics
from wingfit.records import FourierFlap, PassivePitch, Vehicle, WingMotion
from wingfit.records.description.convert import to_dataclass
from wingfit.records.description.vehicle_file import VehicleFile
from wingfit.records.description.yaml_text import read_yaml
from wingfit.records.files.forces import read_forces

FREQUENCY = 12.5
NAMES = ("nose", "trailing", "left", "right", "fin", "belly")


@pytest.fixture
def wingfit() -> Wingfit:
    app = typer.Typer()
    app.command()(kinematics)
    app.command()(forces)

    return in_process(app)


def write(path: Path, header: list[str], rows: np.ndarray) -> Path:
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(header)
        writer.writerows([["" if v != v else repr(float(v)) for v in row] for row in rows])
    return path


def columns(names: tuple[str, ...]) -> list[str]:
    return ["time_s", *(f"{name}_{axis}_m" for name in names for axis in "xyz")]


@pytest.fixture
def table(tmp_path: Path) -> Path:
    t = np.arange(600) / 1200
    zeta, rate, _ = split_cycle((t - 0.02) * FREQUENCY, FREQUENCY)
    draw = noise(np.random.default_rng(0), (600, 2), 0.3, 0, 0)
    rows = np.column_stack([t, np.degrees(zeta) + draw[:, 0], np.degrees(passive_pitch(zeta, rate)) + draw[:, 1]])
    return write(tmp_path / "angles.csv", ["time_s", "flap_angle_deg", "wing_pitch_deg"], rows)


@pytest.fixture
def flight(tmp_path: Path) -> tuple[Path, Path]:
    t = times(300)
    turns = np.broadcast_to(pitched(1.2), (300, 3, 3))
    tracks = seen_from(np.outer(t, [0.65, 0, 0]), turns) + noise(np.random.default_rng(1), (300, 6, 3), 1e-4, 0, 0)
    tracks[50:60, 2] = np.nan
    seen = write(tmp_path / "flight.csv", columns(NAMES), np.column_stack([t, tracks.reshape(300, -1)]))
    body = tmp_path / "body.csv"
    places = zip((*NAMES, "centre_of_mass"), [*MARKERS, CENTRE], strict=True)
    body.write_text("marker,x_m,y_m,z_m\n" + "".join(f"{n},{p[0]},{p[1]},{p[2]}\n" for n, p in places))
    return seen, body


def motion_of(path: Path) -> WingMotion:
    """The motion as a dataset would read it."""
    motion = read_yaml(path.read_bytes(), path.name).data["motion"]
    vehicle = {
        "name": "v", "layout": "x4", "claps": True, "wing_mass_kg": 0.0003, "thickness_m": 0.00001,
        "stations": [{"r_m": 0, "chord_m": 0.08}, {"r_m": 0.14, "chord_m": 0.06}],
        "pitch_axis": 0, "dihedral_deg": 0, "mass_kg": 0.0174, "motion": motion,
    }  # fmt: skip
    return to_dataclass(Vehicle, VehicleFile.model_validate(vehicle)).motion


def test_a_table_becomes_the_motion_of_a_dataset(wingfit: Wingfit, table: Path, tmp_path: Path) -> None:
    out, page = tmp_path / "motion.yaml", tmp_path / "motion.html"
    code, shown, _ = wingfit("kinematics", table, "--pitch", "passive", "-o", out, "--plot", page)
    assert code == 0
    assert float(shown.split("flap frequency ")[1].split()[0]) == pytest.approx(FREQUENCY, abs=0.005)
    assert "a beat starts at time_s 0.0" in shown
    assert "chosen by cross-validation" in shown
    assert "Eq. 17, flap: -1.1" in shown
    motion = motion_of(out)
    assert isinstance(motion.flap, FourierFlap)
    assert isinstance(motion.pitch, PassivePitch)
    assert motion.pitch_station == 0.7
    assert motion.root_pitch == pytest.approx(np.pi / 2)
    assert motion.flap.mean == pytest.approx(0.34, abs=0.01)
    assert motion.flap.cosine[0] == pytest.approx(-0.34, abs=0.01)
    text = page.read_text(encoding="utf-8")
    assert "wing pitch, deg: measured, 2 standard errors, Fourier series" in text
    assert text.count("<figure>") == 6


def test_tracks_give_the_same_motion_as_a_table(wingfit: Wingfit, tmp_path: Path) -> None:
    t = np.arange(400) / 1200
    zeta, rate, _ = split_cycle(t * FREQUENCY, FREQUENCY)
    edge, chord = wing_markers(zeta, passive_pitch(zeta, rate), False, True, 0.1)
    rows = np.column_stack([t, np.concatenate([edge, chord], axis=1).reshape(400, -1)])
    path, out = write(tmp_path / "wing.csv", columns(("a", "b", "c", "d", "e")), rows), tmp_path / "motion.yaml"
    words = ("--leading-edge", "a,b,c", "--chord", "d,e", "--wing", "lower-right", "--dihedral-deg", np.degrees(0.1))
    assert wingfit("kinematics", path, *words, "-o", out)[0] == 0
    flap = motion_of(out).flap
    assert isinstance(flap, FourierFlap)
    assert flap.cosine[0] == pytest.approx(-0.34, abs=0.01)


def test_phases_need_the_frequency_and_keep_their_start(wingfit: Wingfit, table: Path, tmp_path: Path) -> None:
    rows = np.loadtxt(table, delimiter=",", skiprows=1)
    rows[:, 0] = (rows[:, 0] - 0.02) * FREQUENCY % 1
    header = ["t_star", "flap_angle_deg", "wing_pitch_deg"]
    path = write(tmp_path / "phases.csv", header, rows[24:])
    code, _, err = wingfit("kinematics", path)
    assert code == 2
    assert "--flap-hz" in err
    code, shown, _ = wingfit("kinematics", path, "--flap-hz", FREQUENCY)
    assert code == 0
    assert "not at the start given" not in shown


def test_tracks_become_forces_that_a_dataset_reads(wingfit: Wingfit, flight: tuple[Path, Path], tmp_path: Path) -> None:
    out, more, page = tmp_path / "hover.csv", tmp_path / "more.csv", tmp_path / "forces.html"
    words = ("--body", flight[1], "--mass-kg", 0.0174, "--flap-hz", FREQUENCY, "--beat-start-s", 0.01)
    code, shown, _ = wingfit("forces", flight[0], *words, "-o", out, "--details", more, "--plot", page)
    assert code == 0, shown
    read = read_forces(out.read_bytes(), out.name)
    mean = read.values.mean(axis=0)
    np.testing.assert_allclose(mean, 0.0174 * 9.80665 * np.array([np.sin(1.2), -np.cos(1.2)]), atol=2e-3)
    assert 0 <= read.times[0] < 1 / FREQUENCY
    assert "low_pass: {cutoff_hz: 40" in shown
    assert "rig: free_flight" in shown
    rows = list(csv.DictReader(more.open()))
    assert len(rows) == 300
    assert float(rows[150]["force_x_sd_n"]) > 0
    assert "moment_x_n_m" not in rows[0]
    assert "Force z: 2 standard deviations, force" in page.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--mass-kg", 0), ("--mass-kg", "0.000001")),
        (("--flap-hz", 40), ("128 Hz", "90 Hz", "record faster")),
        (("--inertia", "1,2"), ("1,2", "four numbers", "kg m^2")),
        (("--inertia", "1,-2,3,0"), ("not positive",)),
        (("--plot", "forces.txt"), (".html",)),
    ],
)
def test_wrong_use_of_forces_is_reported(
    wingfit: Wingfit, flight: tuple[Path, Path], words: tuple[object, ...], expected: tuple[str, ...]
) -> None:
    given = ["forces", flight[0], "--body", flight[1], "--mass-kg", 0.0174, "--flap-hz", 12.5, *words]
    code, _, err = wingfit(*given)
    assert code in (1, 2)
    flat = " ".join(err.replace("│", " ").split())
    assert all(word in flat for word in expected), flat


@pytest.mark.parametrize(
    ("text", "words", "expected"),
    [
        ("", (), ("header and rows",)),
        ("time_s,flap_angle_deg,wing_pitch_deg\n0,1,abc\n", (), ("row 1", "'wing_pitch_deg'", "'abc'", "finite")),
        ("time_s,flap_angle_deg,wing_pitch_deg\n0,1\n", (), ("2 cells", "3")),
        ("time_s,flap_angle_deg,wing_pitch_deg\n1,1,1\n0,2,2\n", (), ("increase", "sort")),
        ("time_s,flap_angle,wing_pitch_deg\n0,1,1\n1,1,1\n", (), ("'flap_angle_deg'", "did you mean 'flap_angle'")),
        ("time_s,a_x_m,a_y_m,a_z_m\n0,1,1,1\n1,1,1,1\n", (), ("--leading-edge",)),
        ("time_s,a_x_m,a_y_m,a_z_m\n0,1,1,1\n1,1,1,1\n", ("--leading-edge", "a"), ("1 marker", "hinge")),
        ("time_s;flap_angle_deg\n0;1\n", (), ("separate columns by commas",)),
    ],
)
def test_errors_in_tables_are_reported(
    wingfit: Wingfit, tmp_path: Path, text: str, words: tuple[str, ...], expected: tuple[str, ...]
) -> None:
    path = tmp_path / "table.csv"
    path.write_text(text)
    code, _, err = wingfit("kinematics", path, *words)
    assert code == 1
    assert all(word in err for word in expected), err


def test_a_body_file_given_as_angles_is_refused(wingfit: Wingfit, flight: tuple[Path, Path]) -> None:
    code, _, err = wingfit("kinematics", flight[1])
    assert code == 1
    assert "body.csv, line 1: there is no column 'time_s', no 'flap_angle_deg', no 'wing_pitch_deg'" in err
    assert "known: marker, x_m, y_m, z_m" in err
    code, _, err = wingfit("forces", flight[1], "--body", flight[1], "--mass-kg", 0.0174, "--flap-hz", FREQUENCY)
    assert code == 1
    assert "body.csv, line 1: there is no column 'time_s', no 'nose_x_m'" in err
    assert "'nose_y_m', no 'nose_z_m', no 'trailing_x_m', no 'trailing_y_m', ...;" in err


def test_angles_in_radians_are_remarked_on(wingfit: Wingfit, table: Path, tmp_path: Path) -> None:
    assert "radians" not in wingfit("kinematics", table)[1]
    rows = np.loadtxt(table, delimiter=",", skiprows=1)
    rows[:, 1:] = np.radians(rows[:, 1:])
    path = write(tmp_path / "radians.csv", ["time_s", "flap_angle_deg", "wing_pitch_deg"], rows)
    code, shown, _ = wingfit("kinematics", path)
    assert code == 0
    assert "note: flap_angle_deg ranges over 0.6" in shown
    assert "deg only; if these are radians, convert to degrees" in shown


def test_tracks_in_millimetres_are_refused(wingfit: Wingfit, flight: tuple[Path, Path], tmp_path: Path) -> None:
    rows = np.genfromtxt(flight[0], delimiter=",", skip_header=1)
    rows[:, 1:] *= 1e3
    path = write(tmp_path / "mm.csv", columns(NAMES), rows)
    code, _, err = wingfit("forces", path, "--body", flight[1], "--mass-kg", 0.0174, "--flap-hz", FREQUENCY)
    assert code == 1
    assert "looks like millimetres in the tracks" in err


@pytest.mark.parametrize(("name", "command"), [("kinematics", kinematics), ("forces", forces)])
def test_help_holds_an_example(wingfit: Wingfit, name: str, command: Callable[..., None]) -> None:
    assert f"Example: wingfit {name}" in (command.__doc__ or "")
    assert wingfit(name, "--help")[0] == 0
