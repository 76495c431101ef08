"""Compare the periodic state of an FMU with wingfit's own simulation under the same condition."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.export.fmu.importer import Fmu
from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.fmu.conditions import reference_condition
from wingfit.export.fmu.variables import INPUTS
from wingfit.export.fmu.vehicle_laws import recording_at
from wingfit.records import Condition
from wingfit.records.array_types import Array
from wingfit.sim.virtual_rigs.campaign import blank_recording
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.loads import simulate_outputs

BEATS = 24  # after which the wing of the example is periodic
SETTLED = 2  # beats of a vehicle, whose forces are periodic at once


@dataclass(frozen=True)
class Errors:
    """Largest errors of an FMU: of markers (mm) and of forces and torques (percent of the amplitude)."""

    markers_mm: float
    forces_percent: float

    def and_those(self, other: Errors) -> Errors:
        """Return the larger of both."""
        return Errors(max(self.markers_mm, other.markers_mm), max(self.forces_percent, other.forces_percent))


def inputs_at(condition: Condition, model: CalibratedModel) -> dict[str, float]:
    """Return the inputs of an FMU for a condition."""
    return {name: getattr(condition, name) for name in INPUTS if model.kind == "tracks" or name != "phase_lag"}


def wing_errors(model: CalibratedModel, fmu: Fmu, condition: Condition, beats: int = BEATS) -> Errors:
    """Return the errors of a wing's markers, air force and torques in its beat number ``beats`` from rest."""
    wing = model.simulation()
    assert isinstance(wing, FlexibleWing)  # noqa: S101
    genome, recording = model.genome(condition), blank_recording(wing.wing, condition)
    tracks, loads = wing.beat(genome, recording).tracks, simulate_outputs(wing, genome, recording)
    # loads of the strips contain the force of added mass, which a beat, like the FMU, does not
    same = replace(wing, numerics=replace(wing.numerics, steps=len(loads.phase)))
    wanted = same.beat(genome, recording).air
    markers = [f"marker.{one.name}.{axis}" for one in wing.wing.markers for axis in "xyz"]
    forces = [f"air_force.{axis}" for axis in "xyz"]
    torques = ["front.torque", "rear.torque"]
    n = len(loads.phase)
    running, dt = fmu.started(inputs_at(condition, model)), 1.0 / (condition.flap_frequency * n)
    for _ in range(beats * n):
        running.step(dt)
    found = running.series([*markers, *forces, *torques], dt, n)
    running.close()
    shared = int(np.gcd(n, len(tracks)))
    own = found[:: n // shared, : len(markers)].reshape(shared, -1, 3)
    apart = np.linalg.norm(own - tracks[:: len(tracks) // shared], axis=2).max()
    air, motors = found[:, -5:-2], found[:, -2:]
    torque = np.stack([one.torque for one in loads.motors], axis=1)
    return Errors(1e3 * float(apart), max(percent(air, wanted), percent(motors, torque)))


def vehicle_errors(model: CalibratedModel, fmu: Fmu, condition: Condition) -> Errors:
    """Return the errors of a vehicle's forces over a beat."""
    n = int(getattr(model.simulation(), "instants"))  # noqa: B009
    running, dt = fmu.started(inputs_at(condition, model)), 1.0 / (condition.flap_frequency * n)
    found = running.series(["force.x", "force.z"], dt, SETTLED * n)[-n:]
    running.close()
    simulated = model.simulation()
    assert not isinstance(simulated, FlexibleWing)  # noqa: S101
    wanted = simulated.beat(np.array(model.genome(condition)), recording_at(condition))[0]
    return Errors(0.0, percent(found, wanted))


def percent(found: Array, wanted: Array) -> float:
    """Return the largest difference in percent of the largest amplitude among the columns of ``wanted`` [n, C]."""
    return 100.0 * float(np.abs(found - wanted).max() / (0.5 * np.ptp(wanted, axis=0).max()))


def conditions_within(model: CalibratedModel, count: int, seed: int = 1) -> list[Condition]:
    """Return ``count`` random conditions within the fitted range, with the air of the FMU."""
    random, start = np.random.default_rng(seed), reference_condition(model)
    ends = {one.name: (one.low, one.high) for one in model.ranges if one.name in INPUTS}
    fixed: Mapping[str, float] = {name: getattr(start, name) for name in ("pressure", "temperature", "gravity")}
    return [
        Condition(**{name: float(random.uniform(*end)) for name, end in ends.items()}, **fixed) for _ in range(count)
    ]
