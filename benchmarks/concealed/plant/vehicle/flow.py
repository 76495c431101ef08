"""Motion of a vehicle's blade elements over a beat, and density of the air."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from wingfit.records import Condition, Vehicle

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

GAS = 287.05  # J/(kg K), of dry air
_NONE = np.zeros((0, 0), complex)


@dataclass(frozen=True)
class Flow:
    """Motion of the blade elements of the wings on one side over a beat: n instants, E elements along the span.

    Complex vectors: the real part is along body x (axes of the stroke) or along the chord (axes of the chord), the
    imaginary part normal to it.

    Attributes:
        t: beats from the start of the beat.
        r, chord: radius and chord of the elements [E], m.
        frequency: flapping frequency, Hz.
        rho: density of the air, kg/m^3.
        span: length of a wing, m.
        zeta, rate, acceleration: flap angle and its first two time derivatives [n] (rad, s).
        level: cosine of the wing's angle to the horizontal [n].
        theta, turn, turn_rate: pitch angle and its first two time derivatives [n, E] (rad, s).
        own, own_rate: velocity due to flapping and airspeed in axes of the stroke, complex, and its time derivative
            [n, E] (m, s).
        peel, peeled: fraction of each instant in which the two wings peel apart, and of the chord that has separated
            [n] (clap and peel).
        met: velocity through the air in axes of the chord, complex, with all inflow and gusts [n, E], m/s.
    """

    t: Array
    r: Array
    chord: Array
    frequency: float
    rho: float
    span: float
    zeta: Array
    rate: Array
    acceleration: Array
    level: Array
    theta: Array
    turn: Array
    turn_rate: Array
    own: Complex
    own_rate: Complex
    peel: Array
    peeled: Array
    met: Complex = field(default_factory=lambda: _NONE)

    def turned(self, q: Complex) -> Complex:
        """Transform complex vectors ``q`` [n, E] from axes of the stroke to those of the chord, or back."""
        return np.asarray(1j * np.exp(-1j * self.theta) * np.conj(q))

    @property
    def speed(self) -> Array:
        """Airspeed of each element, m/s [n, E]; never zero."""
        return np.abs(self.met) + 1e-12

    def travelled(self, speed: Array) -> Array:
        """Distance travelled since the start of the beat [n + 1, E], in half chords, at ``speed`` [n, E] (m/s).

        The last row is the distance of the whole beat.
        """
        step = 1.0 / (self.frequency * len(self.t))
        closed = np.concatenate([speed, speed[:1]])
        way = np.cumsum(0.5 * (closed[1:] + closed[:-1]), axis=0) * step * 2.0 / self.chord
        return np.concatenate([np.zeros((1, len(self.r))), way])


def density(air: Condition) -> float:
    """Density of dry air at the pressure and temperature of ``air``, kg/m^3."""
    return air.pressure / (GAS * air.temperature)


def wing_area(vehicle: Vehicle) -> float:
    """Area of one wing, m^2."""
    return float(np.trapezoid([s.chord for s in vehicle.stations], [s.r for s in vehicle.stations]))


def mean_chord(vehicle: Vehicle) -> float:
    """Area of one wing over its span, m."""
    return wing_area(vehicle) / vehicle.span


def mass_per_length(flow: Flow, vehicle: Vehicle) -> Array:
    """Mass of a wing per length of span [E], kg/m, in proportion to the chord (Armanini et al. 2016, Eq. 14)."""
    return vehicle.wing_mass * flow.chord / wing_area(vehicle)


def followed(target: Array, steps: Array) -> Array:
    """Periodic solution x [n, E] of x' = target - x, for steps ``steps`` [n, E] in units of the time constant."""
    keep = np.exp(-steps)
    start = np.zeros(target.shape[1])
    for _ in range(2):  # the first round gives the correction of the start value
        x = start.copy()
        out = np.empty_like(target)
        for k in range(len(target)):
            out[k] = x
            x = target[k] + (x - target[k]) * keep[k]
        start = start + (x - start) / (1.0 - np.prod(keep, axis=0))
    return out
