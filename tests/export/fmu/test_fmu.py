"""Exported FMUs: valid, equal to the simulation, without Python, with states, within the fitted range."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.oracles.exports.fmus import Fmu, Running, conditions_within, inputs_at, percent, problems, vehicle_errors
from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.fmu import NotExportedError
from wingfit.export.fmu.conditions import reference_condition
from wingfit.export.fmu.package import c_compiler
from wingfit.export.model_file import model_from_json
from wingfit.rigs.doors.fmu import fmu as door
from wingfit.rigs.run import Run
from wingfit.sim.virtual_rigs.campaign import blank_recording
from wingfit.sim.wing.flexible_wing import FlexibleWing

FORCES = ("force.x", "force.y", "force.z", "moment.x", "air_force.z")


def _failed(call: Any, *arguments: Any) -> bool:
    import fmpy.fmi1

    try:
        call(*arguments)
    except fmpy.fmi1.FMICallException:
        return True
    return False


def _begun(fmu: Fmu, model: CalibratedModel, changed: Mapping[str, float] | None = None) -> Running:
    return fmu.started({**inputs_at(reference_condition(model), model), **(changed or {})})


def test_both_fmus_are_valid_and_carry_their_model(
    wing_fmu: Fmu, vehicle_fmu: Fmu, wing: CalibratedModel, global_vehicle: CalibratedModel
) -> None:
    for fmu, model in ((wing_fmu, wing), (vehicle_fmu, global_vehicle)):
        assert problems(fmu.path) == []
        with zipfile.ZipFile(fmu.path) as archive:
            assert model_from_json(archive.read("resources/model.json")) == model
            assert model.provenance.id in archive.read("documentation/index.html").decode()


def test_a_wing_becomes_the_periodic_motion_of_the_simulation(wing_fmu: Fmu, wing: CalibratedModel) -> None:
    condition = wing.recordings[1].condition
    assert condition is not None
    simulated = wing.simulation()
    assert isinstance(simulated, FlexibleWing)
    beat = simulated.beat(wing.genome(condition), blank_recording(simulated.wing, condition))
    n = len(beat.tracks)
    running, dt = wing_fmu.started(inputs_at(condition, wing)), 1.0 / (condition.flap_frequency * n)
    markers = [f"marker.{one.name}.{axis}" for one in simulated.wing.markers for axis in "xyz"]
    running.series(["beat_phase"], dt, 12 * n)
    found = running.series([*markers, "air_force.x", "air_force.y", "air_force.z"], dt, n)
    running.close()
    apart = found[:, :-3].reshape(n, -1, 3) - beat.tracks
    assert 1e3 * np.linalg.norm(apart, axis=2).max() < 0.1
    assert percent(found[:, -3:], beat.air) < 1.0  # the beat is accurate for markers, not for forces


def test_a_vehicle_has_the_forces_of_the_simulation(vehicle_fmu: Fmu, global_vehicle: CalibratedModel) -> None:
    for condition in conditions_within(global_vehicle, 2):
        assert vehicle_errors(global_vehicle, vehicle_fmu, condition).forces_percent < 1e-6


def test_an_importer_in_c_needs_no_python_and_restores_states(
    wing_fmu: Fmu, wing: CalibratedModel, vehicle_fmu: Fmu, global_vehicle: CalibratedModel
) -> None:
    for fmu, model in ((wing_fmu, wing), (vehicle_fmu, global_vehicle)):
        condition = reference_condition(model)
        dt, count = 1.0 / (200.0 * condition.flap_frequency), 100
        outputs = [one for one in fmu.references if one.startswith("force.")]
        driven = fmu.by_driver(inputs_at(condition, model), outputs, dt, count)
        assert driven.identical
        assert not driven.python
        running = fmu.started(inputs_at(condition, model))
        running.series(outputs, dt, count)
        assert np.array_equal(running.get(outputs), driven.outputs[-1])
        running.close()


def test_the_libraries_need_nothing_but_the_c_library(wing_fmu: Fmu, vehicle_fmu: Fmu) -> None:
    tool = shutil.which("nm")
    if tool is None:
        pytest.skip("nm, which lists symbols, is not installed: apt install binutils")
    for fmu in (wing_fmu, vehicle_fmu):
        listed = subprocess.run([tool, "-D", str(fmu.library)], check=True, capture_output=True, text=True).stdout
        kinds = [line.split()[-2:] for line in listed.splitlines()]
        assert [name for kind, name in kinds if kind == "U" and "@GLIBC" not in name] == []
        assert [name for kind, name in kinds if kind == "T" and not name.startswith("fmi3")] == []


def test_a_state_is_restored_after_inputs_have_changed(wing_fmu: Fmu, wing: CalibratedModel) -> None:
    running = _begun(wing_fmu, wing)
    running.series(FORCES, 1e-3, 50)
    state = running.slave.getFMUState()
    bytes_of_it = running.slave.serializeFMUState(state)
    first = running.series(FORCES, 1e-3, 50)
    running.set({"flap_frequency": 3.9})
    running.series(FORCES, 1e-3, 20)
    running.slave.setFMUState(running.slave.deserializeFMUState(bytes_of_it))
    running.time = 0.05
    assert np.array_equal(running.series(FORCES, 1e-3, 50), first)
    running.close()


def test_the_phase_is_continuous_when_the_frequency_jumps(vehicle_fmu: Fmu, global_vehicle: CalibratedModel) -> None:
    running = _begun(vehicle_fmu, global_vehicle, {"flap_frequency": 11.0})
    before = running.series(["beat_phase", "flap_angle"], 1e-4, 1000)
    running.set({"flap_frequency": 13.0})
    after = running.series(["beat_phase", "flap_angle"], 1e-4, 5000)
    running.close()
    turned = np.unwrap(2 * np.pi * np.concatenate([before, after])[:, 0]) / (2 * np.pi)
    steps = np.diff(turned) / 1e-4
    assert np.allclose(steps[:999], 11.0)
    assert np.allclose(steps[4000:], 13.0)
    assert np.abs(np.diff(steps)).max() < 0.1  # Hz, from one step to the next
    # it lags two time constants of 0.02 s behind: 2 Hz times 0.04 s less than a jump
    assert turned[-1] == pytest.approx(11.0 * 0.1 + 13.0 * 0.4999 - 2.0 * 0.04, abs=1e-6)


def test_inputs_outside_the_fitted_range_are_refused_and_the_state_is_kept(
    wing_fmu: Fmu, wing: CalibratedModel
) -> None:
    running = _begun(wing_fmu, wing)
    running.series(FORCES, 1e-3, 20)
    seen = running.get(FORCES)
    running.set({"airspeed": 30.0})
    assert _failed(running.step, 1e-3)
    assert "airspeed is 30 m/s; the model was fitted from" in running.messages[-1]
    assert "extrapolate" in running.messages[-1]
    assert np.array_equal(running.get(FORCES), seen)
    running.set({"airspeed": 4.0})
    running.step(1e-3)
    running.close()
    beyond = wing_fmu.started({"airspeed": 12.0}, extrapolate=True)
    beyond.step(1e-3)
    beyond.close()
    assert _failed(wing_fmu.started, {"flap_frequency": 50.0})
    assert _failed(wing_fmu.started, {"airspeed": float("nan")})


def test_a_reset_gives_the_same_outputs_and_parameters_stay(wing_fmu: Fmu, wing: CalibratedModel) -> None:
    running = _begun(wing_fmu, wing)
    first = running.series(FORCES, 2e-3, 30)
    assert _failed(running.set, {"ramp_beats": 2.0})
    assert _failed(running.set, {"force.x": 0.0})
    running.slave.reset()
    running.set(inputs_at(reference_condition(wing), wing))
    running.slave.enterInitializationMode()
    running.slave.exitInitializationMode()
    running.time = 0.0
    assert np.array_equal(running.series(FORCES, 2e-3, 30), first)
    running.close()


def test_the_door_to_fmus_takes_an_exported_one(vehicle_fmu: Fmu, global_vehicle: CalibratedModel) -> None:
    start = inputs_at(reference_condition(global_vehicle), global_vehicle)
    simulate = door(vehicle_fmu.path, {"lift": "lift"}, {"smoothing": "input_time"}, list(start))
    times = np.linspace(0.0, 0.2, 101)
    inputs = {name: np.full(2, value) for name, value in start.items()}
    run = Run("r", times, {}, inputs, np.array([0.0, 0.2]))
    running = vehicle_fmu.started(start)
    wanted = running.series(["lift"], 0.002, 101)[:, 0]
    running.close()
    assert np.allclose(simulate({"smoothing": 0.02}, run)["lift"], wanted, atol=1e-9)


def test_without_a_compiler_the_error_has_the_remedy(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(NotExportedError, match="apt install gcc"):
        c_compiler()
