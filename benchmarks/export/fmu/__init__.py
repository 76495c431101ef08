"""Exported FMUs: valid, without Python, and equal to wingfit's own simulation."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.export.fmu.change import change_errors
from benchmarks.export.fmu.importer import Fmu
from benchmarks.export.fmu.models import true_vehicle, true_wing
from benchmarks.export.fmu.steady import Errors, conditions_within, inputs_at, vehicle_errors, wing_errors
from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.fmu import write_fmu
from wingfit.export.fmu.conditions import reference_condition
from wingfit.records import Condition

# Effects of a wing that act together, and those of a vehicle: at once, and with a memory of the flow.
WING_EFFECTS = ("viscoelastic", "hysteresis", "compliant_drive", "added_mass", "circulation_lag", "tip_loss")
MORE_EFFECTS = ("rod_slip", "cable", "backlash", "clap_and_peel", "wake_capture", "induced_inflow", "hinge_tilt")
VEHICLE_EFFECTS = (
    "clap_and_peel", "varying_coefficients", "stroke_amplitude", "airspeed_error", "wing_pitch_phase",
    "wing_length_error", "wing_chord_error",
)  # fmt: skip
MEMORY_EFFECTS = ("circulation_lag", "body_drag", "induced_inflow")
SLOPES = {"C_l": (-0.15, -0.5), "C_r": (0.02, 0.05)}


def measured() -> dict[str, Any]:
    """Return the figures of the benchmark by name."""
    cases = {
        "wing": true_wing(),
        "wing_effects": true_wing(WING_EFFECTS, "4"),
        "wing_more_effects": true_wing(MORE_EFFECTS, "4"),
        "vehicle": true_vehicle(slopes=SLOPES),
        "vehicle_effects": true_vehicle(VEHICLE_EFFECTS, ("clap_and_peel",)),
        "vehicle_memory_effects": true_vehicle(MEMORY_EFFECTS),
    }
    found: dict[str, Any] = {}
    with TemporaryDirectory() as folder:
        for name, model in cases.items():
            path = Path(folder, f"{name}.fmu")
            write_fmu(model, path)
            with Fmu(path) as fmu:
                found[name] = _measured(model, fmu)
    return {
        "fmu_valid": all(one["valid"] for one in found.values()),
        "fmu_needs_python": any(one["needs_python"] for one in found.values()),
        "max_error_mm": max(one["error_mm"] for one in found.values()),
        "max_force_error_percent": max(one["force_error_percent"] for one in found.values()),
        "us_per_step": found["wing"]["us_per_step"],
        "state_restored_identical": all(one["identical"] for one in found.values()),
        "fmus": found,
    }


def _measured(model: CalibratedModel, fmu: Fmu) -> dict[str, Any]:
    start = reference_condition(model)
    wing = model.kind == "tracks"
    errors = Errors(0.0, 0.0)
    for condition in (start, *conditions_within(model, 3)):
        errors = errors.and_those((wing_errors if wing else vehicle_errors)(model, fmu, condition))
    if wing and not model.settings.effects:
        errors = errors.and_those(change_errors(model, fmu, *_ends(model)))
    return {
        "valid": not problems(fmu.path),
        "error_mm": errors.markers_mm,
        "force_error_percent": errors.forces_percent,
        **_steps(model, fmu, start),
    }


def problems(path: Path) -> Sequence[str]:
    """Return what FMPy finds wrong in the FMU ``path``, by the schema and the rules of FMI 3.0."""
    from fmpy.validation import validate_fmu

    return list(validate_fmu(str(path)))


def _ends(model: CalibratedModel) -> tuple[Condition, Condition]:
    """Two conditions at opposite ends of the fitted range, with the air of the FMU."""
    ends, start = {one.name: one for one in model.ranges}, reference_condition(model)
    names = ("flap_frequency", "phase_lag", "airspeed", "angle_of_attack")
    fixed = {name: getattr(start, name) for name in ("pressure", "temperature", "gravity")}
    first = Condition(**{name: ends[name].low for name in names}, **fixed)
    return first, Condition(**{name: ends[name].high for name in names}, **fixed)


def _steps(model: CalibratedModel, fmu: Fmu, condition: Condition) -> dict[str, Any]:
    """Time of a step, and whether the importer in C finds what FMPy finds, without Python, also after a restart."""
    dt, count = 1.0 / (216.0 * condition.flap_frequency), 2 * 216
    values = inputs_at(condition, model)
    outputs = [one for one in fmu.references if one.startswith(("force.", "marker."))]
    running = fmu.started(values)
    used = time.process_time()
    for _ in range(count):
        running.step(dt)
    used = time.process_time() - used
    last = running.get(outputs)
    running.close()
    driven = fmu.by_driver(values, outputs, dt, count)
    return {
        "us_per_step": 1e6 * used / count,
        "identical": driven.identical and bool(np.array_equal(driven.outputs[-1], last)),
        "needs_python": driven.python,
    }
