"""The bench of the flapping vehicle: the blade-element plant on a force balance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.benches.bench import Bench, Made
from benchmarks.concealed.plant.law import Concealed, Law
from benchmarks.concealed.plant.measurement.balance import FAULTS as BALANCE_FAULTS
from benchmarks.concealed.plant.measurement.balance import Weighing, draw_weighing, silent, weigh
from benchmarks.concealed.plant.vehicle.laws import LAWS as VEHICLE_LAWS
from benchmarks.concealed.plant.vehicle.simulate import PROPOSED
from benchmarks.concealed.plant.vehicle.simulate import simulate as simulate_vehicle
from benchmarks.concealed.rigs import VEHICLES
from benchmarks.concealed.strength import rms
from benchmarks.concealed.trials import FLING
from wingfit.calibration.preparation import as_fitted
from wingfit.calibration.spec import CalibrationSpec
from wingfit.records import Condition, Recording, Vehicle
from wingfit.sim.vehicle.terms import DRAG

Array = npt.NDArray[np.float64]

BALANCE_BEATS = 12
DELFLY_MASS = 17.4e-3  # for which settings of a balance are drawn, kg


class VehicleBench(Bench[Array, Weighing]):
    """Bench of the DelFly: its plant, on a force balance."""

    @cached_property
    def rig(self) -> Vehicle:
        """The vehicle."""
        return VEHICLES[self.build.body][0]

    @property
    def searched(self) -> tuple[str, ...]:
        """Names of the genes that a diagnosis fits; as both axes are recorded, also those of drag."""
        return (*self.model.searched, *DRAG)

    def described(self, rng: np.random.Generator) -> Vehicle:  # noqa: ARG002
        """Return the vehicle: its wings are weighed and its motion is measured."""
        return self.rig

    @property
    def faults(self) -> Mapping[str, Law]:
        """Faults of the balance."""
        return BALANCE_FAULTS

    @property
    def physics(self) -> Mapping[str, Law]:
        """Effects in the wings and the air that can be hidden."""
        return VEHICLE_LAWS

    def quality(self, rng: np.random.Generator) -> Weighing:
        """Settings of a balance drawn from ``rng``, for the vehicle's weight, which records BALANCE_BEATS beats."""
        drawn, heavy = draw_weighing(rng), self.rig.mass / DELFLY_MASS
        larger = {name: heavy * getattr(drawn, name) for name in ("sensor", "rattle", "wander")}
        return replace(drawn, beats=BALANCE_BEATS, **larger)

    def quieter(self, quality: Weighing, level: float) -> Weighing:
        """Copy of the settings ``quality`` with noise, drift and variation between beats multiplied by ``level``."""
        smaller = {name: level * getattr(quality, name) for name in ("sensor", "rattle", "wander", "scatter", "jitter")}
        return replace(quality, **smaller)

    def least(self, quality: Weighing) -> float:  # noqa: ARG002
        """Factor 1/3 on the noise, because the mean over nine times as many beats has a third of the noise."""
        return 1 / 3

    def ideal(self, quality: Weighing) -> Weighing:
        """Copy of the settings ``quality`` without noise, drift and variation between beats."""
        return silent(quality)

    def fitted(self, recording: Recording) -> Recording:
        """Low-pass the recording at the multiple of the flap frequency used by Armanini et al. (2016), section 3.4."""
        return as_fitted(CalibrationSpec(), recording)

    def simulated(self, condition: Condition, genome: Mapping[str, float], hidden: Concealed) -> Array:
        """Forces [n, 2] along body x and z (N) over one beat."""
        absent = self.build.without if self.rig.claps else (*self.build.without, FLING)
        terms = tuple(term for term in PROPOSED if term not in absent)
        return simulate_vehicle(self.rig, genome, condition, hidden, terms=terms)

    def shown(
        self, beat: Array, condition: Condition, hidden: Concealed, quality: Weighing, rng: np.random.Generator
    ) -> Made:
        """Record the forces ``beat`` [n, 2] (N) with the balance and its faults ``hidden``."""
        made = weigh(beat, self.rig, condition, quality, rng, hidden)
        noise = self.fitted(replace(made.recording, values=made.recording.values - made.clean)).values
        return Made(made.recording, rms(noise.ravel()))
