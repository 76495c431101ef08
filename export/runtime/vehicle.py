"""The forces of a calibrated vehicle, with intervals, inside the range of its recordings."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from wingfit.export.runtime.conditions import condition_of, outside_of, shown
from wingfit.export.runtime.intervals import standard_normal, with_errors
from wingfit.export.runtime.parts import Calibrated
from wingfit.records.dataset import Condition, Recording
from wingfit.records.vehicle import Vehicle
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing

Array = npt.NDArray[np.float64]
AXES = ("x", "z")


@dataclass(frozen=True)
class Forces:
    """Forces of the wings on the body over one beat, along body x (forward, to the nose) and body z (down).

    Attributes:
        condition: of the prediction, by names with units.
        time_s: [n] from the start of the beat, where the wings are closest and begin to open.
        force_n: [n, 2] along x and z, N.
        mean_n: [2] cycle means, N.
        error_n, mean_error_n: their standard errors; None if the model has no covariance, or none was requested.
        remarks: on the prediction.
    """

    condition: dict[str, float]
    time_s: Array
    force_n: Array
    mean_n: Array
    error_n: Array | None
    mean_error_n: Array | None
    remarks: tuple[str, ...]

    def interval(self, level: float = 0.95) -> tuple[Array, Array]:
        """Return the lower and upper ends [n, 2] of the interval of the forces; ValueError without standard errors."""
        return _interval(self.force_n, self.error_n, level)

    def mean_interval(self, level: float = 0.95) -> tuple[Array, Array]:
        """Return the lower and upper ends [2] of the interval of the cycle means; ValueError without errors."""
        return _interval(self.mean_n, self.mean_error_n, level)

    def columns(self, level: float = 0.95) -> dict[str, Array]:
        """Return the series as columns by names with units, with the ends of the interval where errors are known."""
        found = {"time_s": self.time_s}
        found |= {f"force_{axis}_n": self.force_n[:, k] for k, axis in enumerate(AXES)}
        if self.error_n is not None:
            ends = self.interval(level)
            for k, axis in enumerate(AXES):
                found |= {f"force_{axis}_low_n": ends[0][:, k], f"force_{axis}_high_n": ends[1][:, k]}
        return found

    def means(self, level: float = 0.95) -> dict[str, float]:
        """Return the cycle means by names with units, with the ends of the interval where errors are known."""
        found = {f"mean_force_{axis}_n": float(self.mean_n[k]) for k, axis in enumerate(AXES)}
        if self.mean_error_n is not None:
            ends = self.mean_interval(level)
            for k, axis in enumerate(AXES):
                found |= {
                    f"mean_force_{axis}_low_n": float(ends[0][k]), f"mean_force_{axis}_high_n": float(ends[1][k])
                }  # fmt: skip
        return found


@dataclass(frozen=True)
class VehicleModel:
    """A calibrated vehicle with prescribed motion of its wings: quasi-steady blade elements, with effects.

    The flow, and so the force, repeats in every beat: a state of the flow (a lagging circulation, an inflow) is the
    periodic one, and there is no transient. Moments are not part of the model.
    """

    vehicle: Vehicle
    terms: tuple[str, ...]
    elements: int
    instants: int
    peel_width: float
    effects: tuple[str, ...]
    calibrated: Calibrated

    @cached_property
    def simulation(self) -> BladeElementWing:
        """The simulation, whose genes are the parameters of the model, in their order."""
        return BladeElementWing(self.vehicle, self.terms, self.elements, self.instants, self.peel_width, self.effects)

    def forces(
        self, *, extrapolate: bool = False, errors: bool = True, values: dict[str, float] | None = None,
        **condition: float | None,
    ) -> Forces:  # fmt: skip
        """Return the forces over one beat under ``condition``, unfiltered.

        ``condition``: flap_frequency_hz, airspeed_m_s, angle_of_attack_deg (body pitch), pressure_mbar, temperature_c;
        others are the mean of the fitted ones. ``values``: parameters by name that replace calibrated ones. Without
        ``errors``, no standard errors are computed, which is faster. OutsideRangeError outside the fitted range,
        unless ``extrapolate``; ValueError for a value that is impossible.
        """
        where = condition_of(self.calibrated, condition, extrapolate=extrapolate)
        genome = self.genome(where, values)

        def simulate(genomes: Array) -> Array:
            beat = self.simulation.beat(genomes, self.recording(where))
            return np.concatenate([beat, beat.mean(axis=1, keepdims=True)], axis=1)

        found, error = with_errors(simulate, self.calibrated, where, genome) if errors else (simulate(genome)[0], None)
        if not np.isfinite(found).all():
            raise ValueError(f"the forces are not finite at {shown(where)}")
        time = np.arange(self.instants) / (self.instants * where.flap_frequency)
        beat, mean = (None, None) if error is None else (error[:-1], error[-1])
        return Forces(shown(where), time, found[:-1], found[-1], beat, mean, self._remarks(where))

    def wing_motion(self, *, extrapolate: bool = False, **condition: float | None) -> dict[str, Array]:
        """Return the prescribed motion of the wings over a beat: flap angle and wing pitch at the pitch station, rad.

        ``condition`` and errors as in :meth:`forces`.
        """
        where = condition_of(self.calibrated, condition, extrapolate=extrapolate)
        angles = self.simulation.angles(self.genome(where), self.recording(where))
        time = np.arange(self.instants) / (self.instants * where.flap_frequency)
        return {"time_s": time, "flap_rad": angles.flap[0, 0], "wing_pitch_rad": angles.pitch[0, 0]}

    def genome(self, where: Condition, values: dict[str, float] | None = None) -> Array:
        """Return the values [G] of all parameters under a condition; ValueError for an unknown or impossible one."""
        changed = dict(values or {})
        found = [changed.pop(one.name, one.at(where)) for one in self.calibrated.parameters]
        if changed:
            known = ", ".join(one.name for one in self.calibrated.parameters)
            raise ValueError(f"unknown parameter {min(changed)!r}; there are {known}")
        for one, value in zip(self.calibrated.parameters, found, strict=True):
            if not one.lower <= value <= one.upper:
                raise ValueError(f"parameter {one.name} is {value:g}; it must lie in [{one.lower:g}, {one.upper:g}]")
        return np.array(found, float)

    def recording(self, where: Condition) -> Recording:
        """Return a recording without values under a condition, as the simulation takes it."""
        blank = np.full((1, 2), np.nan)
        return Recording("prediction", "wind_tunnel", where, np.zeros(1), (), blank, forces=("x", "z"))

    def _remarks(self, where: Condition) -> tuple[str, ...]:
        return tuple(f"extrapolated: {one}" for one in outside_of(self.calibrated.ranges, where))


def _interval(values: Array, errors: Array | None, level: float) -> tuple[Array, Array]:
    half = standard_normal(level)
    if errors is None:
        raise ValueError("there are no standard errors: the model has no covariance, or errors=False was given")
    return values - half * errors, values + half * errors
