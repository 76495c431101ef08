"""The motion and loads of a calibrated flexible wing, with intervals, inside the range of its recordings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from wingfit.export.runtime.conditions import condition_of, outside_of, shown
from wingfit.export.runtime.intervals import standard_normal, with_errors
from wingfit.export.runtime.parts import Calibrated
from wingfit.records.dataset import Condition, Recording
from wingfit.records.wing import Wing
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.solver.settle import Course, Group, Subject
from wingfit.sim.solver.simulate import Beat, settled_course
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.loads import simulate_outputs
from wingfit.sim.wing.outputs import Outputs

Array = npt.NDArray[np.float64]
INSTANTS = 128  # of a beat in the answers
SETTLED = 1e-7  # m: distance to the periodic motion for derivatives
MOST_BEATS = 60
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Motion:
    """One periodic beat at equal steps from drive phase 0, in the wing's axes: x aft, y outboard, z up.

    Attributes:
        condition: of the prediction, by names with units.
        markers: names of the M markers.
        time_s: [n].
        position_m: [n, M, 3] of the markers, m.
        air_force_n: [n, 3] force of the air on the wing, N; NaN for a rigid wing.
        rod_moment_n_m, rod_force_n: [n, 2, 3] moment and force of the wing on the front and the rear driving rod, in
            the axes of the rod at the hinge; NaN for a rigid wing.
        errors: standard errors of these arrays by name, of their shapes; None if the model has no covariance, or none
            was requested. With ``mean_``: those of the cycle means.
        remarks: on the prediction.
    """

    condition: dict[str, float]
    markers: tuple[str, ...]
    time_s: Array
    position_m: Array
    air_force_n: Array
    rod_moment_n_m: Array
    rod_force_n: Array
    errors: Mapping[str, Array] | None
    remarks: tuple[str, ...]

    def interval(self, name: str = "position_m", level: float = 0.95) -> tuple[Array, Array]:
        """Return the lower and upper ends of the interval of the array ``name``; ValueError without errors."""
        half = standard_normal(level)
        if self.errors is None:
            raise ValueError("there are no standard errors: the model has no covariance, or errors=False was given")
        middle = getattr(self, name)
        return middle - half * self.errors[name], middle + half * self.errors[name]

    def columns(self, level: float = 0.95) -> dict[str, Array]:
        """Return the series as columns by names with units, with the ends of the interval where errors are known."""
        found = {"time_s": self.time_s}
        for name, values, low, high in self._parts(level):
            found[name] = values
            if low is not None and high is not None:
                plain, unit = _split(name)
                found |= {f"{plain}_low_{unit}": low, f"{plain}_high_{unit}": high}
        return found

    def means(self, level: float = 0.95) -> dict[str, float]:
        """Return the cycle means of forces and moments by names with units, with the ends of their intervals."""
        half, found = standard_normal(level), dict[str, float]()
        for array in ("air_force_n", "rod_moment_n_m", "rod_force_n"):
            values = getattr(self, array).mean(axis=0)
            error = None if self.errors is None else self.errors[f"mean_{array}"]
            for index, name in _names(array, self.markers):
                plain, unit = _split(name)
                found[f"mean_{plain}_{unit}"] = float(values[index])
                if error is not None:
                    found[f"mean_{plain}_low_{unit}"] = float(values[index] - half * error[index])
                    found[f"mean_{plain}_high_{unit}"] = float(values[index] + half * error[index])
        return found

    def _parts(self, level: float) -> list[tuple[str, Array, Array | None, Array | None]]:
        parts = list[tuple[str, Array, Array | None, Array | None]]()
        for array in ("position_m", "air_force_n", "rod_moment_n_m", "rod_force_n"):
            values = getattr(self, array)
            ends = (None, None) if self.errors is None else self.interval(array, level)
            for index, name in _names(array, self.markers):
                low, high = (None if end is None else _at(end, index) for end in ends)
                parts.append((name, _at(values, index), low, high))
        return parts


@dataclass(frozen=True)
class WingModel:
    """A calibrated wing of rigid bodies and springs, driven at its root, in quasi-steady air, with effects."""

    wing: Wing
    division: str
    bounds_factor: float
    accuracy: float
    effects: tuple[str, ...]
    calibrated: Calibrated

    @cached_property
    def simulation(self) -> FlexibleWing:
        """The simulation, whose genes are the parameters of the model, in their order."""
        return FlexibleWing(self.wing, self.division, self.bounds_factor, Numerics(self.accuracy), self.effects)

    def motion(
        self, *, extrapolate: bool = False, errors: bool = True, values: Mapping[str, float] | None = None,
        **condition: float | None,
    ) -> Motion:  # fmt: skip
        """Return the periodic motion and the loads under ``condition``.

        ``condition``: flap_frequency_hz, phase_lag_deg, airspeed_m_s, angle_of_attack_deg, pressure_mbar,
        temperature_c; others are the mean of the fitted ones. ``values``: parameters by name that replace calibrated
        ones. Without ``errors`` no standard errors are computed, which is many times faster. OutsideRangeError outside
        the fitted range, unless ``extrapolate``; ValueError for a value that is impossible, or if the wing cannot be
        simulated there.
        """
        where = condition_of(self.calibrated, condition, extrapolate=extrapolate)
        genome = self.genome(where, values)
        beat = self._beat(genome, where)
        whole, means, found = _whole(beat), None, None
        if errors and self.calibrated.covariance is not None:
            same = self._with_steps(len(beat.tracks))

            def simulate(genomes: Array) -> Array:
                beats = same.beats(genomes, self.recording(where))
                found = np.stack([_whole(_checked(one, where)) for one in beats])
                return np.concatenate([found, found.mean(axis=1, keepdims=True)], axis=1)

            _, error = with_errors(simulate, self.calibrated, where, genome)
            if error is not None:
                found = self._arrays(error[:-1])
                means = {f"mean_{name}": array[0] for name, array in self._arrays(error[-1:]).items()}
        time = np.arange(INSTANTS) / (INSTANTS * where.flap_frequency)
        remarks = tuple(f"extrapolated: {one}" for one in outside_of(self.calibrated.ranges, where))
        both = None if found is None or means is None else found | means
        return Motion(shown(where), self._markers, time, **self._arrays(whole), errors=both, remarks=remarks)

    forces = motion

    def loads(self, *, extrapolate: bool = False, **condition: float | None) -> Outputs:
        """Return all loads of one beat: motors, sections, connectors, strips of air, energies; without intervals.

        ``condition`` and errors as in :meth:`motion`; the simulation is more accurate, as loads require.
        """
        where = condition_of(self.calibrated, condition, extrapolate=extrapolate)
        return simulate_outputs(self.simulation, self.genome(where).tolist(), self.recording(where))

    def transient(
        self, beats: int, *, start: Mapping[str, float] | None = None, extrapolate: bool = False,
        **condition: float | None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Return times [t] (s) and marker positions [t, M, 3] (m) of the first ``beats`` beats under ``condition``.

        The wing starts at rest, and the amplitude of the drive grows over the first beat; or, with ``start``, another
        condition, from the periodic motion there, at the beginning of a beat: the condition then changes at once.
        ValueError as in :meth:`motion`.
        """
        if not 1 <= beats <= 1000:
            raise ValueError(f"beats is {beats}; it must be a whole number from 1 to 1000")
        if self.wing.structure == "rigid":
            raise ValueError("a rigid wing follows its drive at once: it has no transient")
        where = condition_of(self.calibrated, condition, extrapolate=extrapolate)
        genome = self.genome(where)
        steps = len(self._beat(genome, where).tracks)
        numerics, course = Numerics(steps=steps), Course(genome)
        if start is not None:
            before = condition_of(self.calibrated, start, extrapolate=extrapolate)
            known = settled_course(self._subject(self.genome(before), before), self.genome(before), numerics)
            if known is None:
                raise ValueError(f"the wing has no periodic motion at {shown(before)}")
            course = Course(genome, known.state)
        group = Group(self._subject(genome, where), [course], steps)
        parts = []
        for number in range(beats):
            group.beat(group.table(numerics, steps, [number + (numerics.ramp_beats if start is not None else 0)]))
            if not group.alive[0]:
                raise ValueError(f"the motion diverges in beat {number + 1}")
            parts.append(group.trace.tracks[..., 0].copy())
        time = np.arange(beats * steps) / (steps * where.flap_frequency)
        return time, np.concatenate(parts)

    def genome(self, where: Condition, values: Mapping[str, float] | None = None) -> Array:
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
        blank = np.full((1, 3 * len(self._markers)), np.nan)
        return Recording("prediction", "wind_tunnel", where, np.zeros(1), self._markers, blank)

    @property
    def _markers(self) -> tuple[str, ...]:
        return tuple(marker.name for marker in self.wing.markers)

    def _beat(self, genome: Array, where: Condition) -> Beat:
        return _checked(self.simulation.beat(genome, self.recording(where)), where)

    def _with_steps(self, steps: int) -> FlexibleWing:
        """Return the simulation with ``steps`` per beat, so close to the periodic motion that it can be differentiated.

        A rigid wing is exact.
        """
        numerics = Numerics(self.accuracy, steps=steps, periodic=SETTLED, max_beats=MOST_BEATS)
        return replace(self.simulation, numerics=numerics)

    def _subject(self, genome: Array, where: Condition) -> Subject:
        model = self.simulation
        acting = tuple(one for one in model.chosen if one.wing and one.on(model.genes, genome[None])[0])
        return model.subject(acting, where)

    def _arrays(self, whole: Array) -> dict[str, Array]:
        """Return the columns of :func:`_whole` as arrays by name."""
        count, n = 3 * len(self._markers), len(whole)
        rods = whole[:, count + 3 :].reshape(n, 2, 6)
        return {
            "position_m": whole[:, :count].reshape(n, -1, 3),
            "air_force_n": whole[:, count : count + 3],
            "rod_moment_n_m": rods[:, :, :3],
            "rod_force_n": rods[:, :, 3:],
        }


def _whole(beat: Beat) -> Array:
    """Return markers, air force and rods of a beat as columns [INSTANTS, 3 M + 15], at equal steps."""
    n = len(beat.tracks)
    columns = np.concatenate([beat.tracks.reshape(n, -1), beat.air, beat.rods.reshape(n, -1)], axis=1)
    spectrum = np.fft.rfft(columns, axis=0)
    kept = np.zeros((INSTANTS // 2 + 1, columns.shape[1]), complex)
    most = min(len(kept), len(spectrum))
    kept[:most] = spectrum[:most]
    if n % 2 == 0 and most == n // 2 + 1 < len(kept):
        kept[most - 1] *= 0.5  # the highest harmonic of an even number stands for two
    return np.asarray(np.fft.irfft(kept, INSTANTS, axis=0) * (INSTANTS / n))


def _checked(beat: Beat, where: Condition) -> Beat:
    if beat.reason is not None:
        raise ValueError(f"the wing cannot be simulated at {shown(where)}: {beat.reason}")
    return beat


def _names(array: str, markers: tuple[str, ...]) -> list[tuple[tuple[int, ...], str]]:
    """Return indices of the numbers of an array at one instant, with the names of their columns."""
    if array == "position_m":
        return [((m, k), f"{marker}_{axis}_m") for m, marker in enumerate(markers) for k, axis in enumerate(AXES)]
    if array == "air_force_n":
        return [((k,), f"air_force_{axis}_n") for k, axis in enumerate(AXES)]
    what, unit = ("moment", "n_m") if array == "rod_moment_n_m" else ("force", "n")
    return [
        ((r, k), f"{rod}_rod_{what}_{axis}_{unit}") for r, rod in enumerate(("front", "rear"))
        for k, axis in enumerate(AXES)
    ]  # fmt: skip


def _at(values: Array, index: tuple[int, ...]) -> Array:
    """Return the series [n] at ``index`` of the other axes."""
    return np.asarray(values.reshape(len(values), -1)[:, np.ravel_multi_index(index, values.shape[1:])])


def _split(name: str) -> tuple[str, str]:
    """Return the name of a column without its unit, and the unit."""
    unit = next(ending for ending in ("n_m", "m", "n") if name.endswith(f"_{ending}"))
    return name.removesuffix(f"_{unit}"), unit
