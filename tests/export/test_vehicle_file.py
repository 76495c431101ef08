"""The Python file of a vehicle: wingfit's numbers without wingfit, intervals, and refusals."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.oracles.exports import FILE_NEEDS, site_of, vehicle_error
from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.formats import FormatError, exported, stem
from wingfit.export.predict import predictor
from wingfit.export.python.vehicle_file import vehicle_file
from wingfit.export.runtime.conditions import OutsideRangeError, condition_of
from wingfit.export.runtime.intervals import gene_covariance
from wingfit.export.runtime.vehicle import VehicleModel
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.vehicle.terms import chosen

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def model(vehicle: CalibratedModel) -> VehicleModel:
    found = predictor(vehicle)
    assert isinstance(found, VehicleModel)
    return found


@pytest.fixture(scope="module")
def run(vehicle: CalibratedModel, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Run the file on the command line, with numpy alone."""
    folder = tmp_path_factory.mktemp("file")
    (folder / "model.py").write_text(vehicle_file(vehicle))
    site = site_of(folder / "site", FILE_NEEDS)
    start = f"import sys; sys.path.insert(0, {str(site)!r}); import runpy; sys.argv = ['model.py', *sys.argv[1:]]; "
    start += f"runpy.run_path({str(folder / 'model.py')!r}, run_name='__main__')"

    def called(*words: str) -> tuple[int, str, str]:
        command = [sys.executable, "-I", "-S", "-c", start, *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        return done.returncode, done.stdout, done.stderr

    return called


def test_it_gives_wingfits_forces_without_wingfit(vehicle: CalibratedModel, tmp_path: Path) -> None:
    assert vehicle_error(vehicle, tmp_path, levels=2) < 1e-9


@pytest.mark.parametrize("name", [n for n, e in EFFECTS.items() if e.vehicle and e.port != "observation"])
def test_every_effect_of_a_vehicle_can_be_copied(vehicle: CalibratedModel, name: str) -> None:
    """Its modules are found; with numpy they give the forces of the compiled ones."""
    term, terms = EFFECTS[name].term, chosen("proposed")
    settings = replace(vehicle.settings, effects=(name,), without=(term,) if term in terms else ())
    plain = replace(vehicle, settings=settings)
    genes = plain.simulation().genes
    values = plain.values | EFFECTS[name].typical(vehicle.vehicle)
    sample = plain.parameters[0]
    parameters = tuple(
        replace(sample, name=g.name, value=values.get(g.name, g.nominal), lower=g.lower, upper=g.upper, per_hz=0.0)
        for g in genes
    )
    changed = replace(plain, parameters=parameters, covariance=None)
    space: dict[str, Any] = {"__name__": f"exported_{name}"}
    exec(compile(vehicle_file(changed), f"{name}.py", "exec"), space)  # noqa: S102  (made above)
    there, here = space["Model"]().forces().force_n, predictor(changed).forces().columns()
    assert np.abs(there[:, 0] - here["force_x_n"]).max() < 1e-9 * np.abs(here["force_x_n"]).max()


def test_the_command_line_predicts(run: Run, model: VehicleModel) -> None:
    code, out, _ = run("--flap-frequency", "12.5", "--body-pitch", "70", "--airspeed", "0.6")
    assert code == 0
    answer = json.loads(out)
    here = model.forces(flap_frequency_hz=12.5, angle_of_attack_deg=70.0, airspeed_m_s=0.6)
    assert answer["mean_force_x_n"] == pytest.approx(here.mean_n[0], rel=1e-9)
    assert answer["mean_force_x_low_n"] < answer["mean_force_x_n"] < answer["mean_force_x_high_n"]
    code, out, _ = run("--csv", "--no-intervals")
    head, *rows = out.splitlines()
    assert (code, head, len(rows)) == (0, "time_s,force_x_n,force_z_n", model.instants)
    code, out, _ = run("--about")
    about = json.loads(out)
    assert about["provenance"]["id"] == "run_1"
    assert about["fitted_range"]["flap_frequency (Hz)"] == [11.7, 13.3]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--flap-frequency", "20"), "flap_frequency_hz 20 is outside [11.7, 13.3] Hz"),
        (("--flap-frequency", "nan"), "flap_frequency_hz is nan; it must be a finite number in Hz"),
        (("--flap-frequency", "-3"), "it must be above 0 Hz"),
        (("--pressure", "500"), "density"),
        (("--level", "1.5"), "level is 1.5; it must lie between 0 and 1"),
    ],
)
def test_the_command_line_refuses(run: Run, words: tuple[str, ...], message: str) -> None:
    code, out, err = run(*words)
    assert (code, out) == (2, "")
    assert message in err
    assert "Traceback" not in err


def test_extrapolation_is_said(model: VehicleModel) -> None:
    with pytest.raises(OutsideRangeError, match="extrapolate=True"):
        model.forces(airspeed_m_s=4.0)
    found = model.forces(airspeed_m_s=4.0, extrapolate=True, errors=False)
    assert found.remarks == ("extrapolated: airspeed_m_s 4 is outside [0.3, 1] m/s",)
    with pytest.raises(ValueError, match="no standard errors"):
        found.interval()


def test_unknown_names_are_refused(model: VehicleModel) -> None:
    with pytest.raises(ValueError, match="unknown condition 'speed'; there are flap_frequency_hz"):
        model.forces(speed=1.0)
    with pytest.raises(ValueError, match="unknown parameter 'C_x'"):
        model.forces(values={"C_x": 1.0})
    with pytest.raises(ValueError, match="parameter C_l is 1e"):
        model.forces(values={"C_l": 1e9})


def test_errors_are_those_of_the_covariance(model: VehicleModel) -> None:
    """The force is linear in the coefficients, so that draws of these scatter as the standard errors say."""
    where = {"flap_frequency_hz": 12.5, "airspeed_m_s": 0.6}
    condition = condition_of(model.calibrated, where, extrapolate=False)
    places, covariance = gene_covariance(model.calibrated, condition)
    base, rng = model.genome(condition), np.random.default_rng(1)
    draws = np.tile(base, (2000, 1))
    draws[:, places] += rng.multivariate_normal(np.zeros(len(places)), covariance, len(draws))
    scatter = model.simulation.beat(draws, model.recording(condition)).mean(axis=1).std(axis=0)
    found = model.forces(**where)  # type: ignore[arg-type]
    assert found.mean_error_n == pytest.approx(scatter, rel=0.06)


def test_a_format_that_does_not_exist_is_refused(vehicle: CalibratedModel) -> None:
    with pytest.raises(FormatError, match="unknown format 'xlsx'; there are python"):
        exported(vehicle, "xlsx")


def test_a_model_without_covariance_has_no_intervals(vehicle: CalibratedModel) -> None:
    found = predictor(replace(vehicle, covariance=None)).forces()
    assert set(found.means()) == {"mean_force_x_n", "mean_force_z_n"}


def test_names_given_by_anybody_stay_text(vehicle: CalibratedModel) -> None:
    evil = 'x"""\\\nraise SystemExit(3)\x00\ud800 {package} \'\'\' """'
    source = replace(vehicle.provenance, name=evil, dataset=evil)
    text = vehicle_file(replace(vehicle, provenance=source, remarks=(evil,)))
    space: dict[str, Any] = {"__name__": "exported"}
    exec(compile(text.encode(), "evil.py", "exec"), space)  # noqa: S102  (made above)
    assert space["CALIBRATED"].provenance.name == evil.replace("{package}", space["_Modules"].package)


@pytest.mark.parametrize(
    ("name", "file"),
    [("DelFly II!", "delfly_ii"), ("4 wings", "model_4_wings"), ("class", "class_model"), ("JSON", "json_model"),
     ("numpy", "numpy_model"), ("../../etc", "etc"), ("\u7fbd", "model")],
)  # fmt: skip
def test_the_file_has_a_name_that_can_be_imported(vehicle: CalibratedModel, name: str, file: str) -> None:
    assert stem(replace(vehicle, rig=replace(vehicle.vehicle, name=name))) == file
