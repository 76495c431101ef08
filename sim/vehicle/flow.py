"""The flow at eight stations along each wing of a batch of individuals, and the resulting forces."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wingfit.records.array_types import Array
from wingfit.sim.vehicle import stations
from wingfit.sim.vehicle.elements import FORWARD, Side
from wingfit.sim.vehicle.stations import STATIONS, Stations


@dataclass
class Flow:
    """The flow at eight stations of the lower wings, then of the upper ones where there are any: [sides, B, n, 8].

    B individuals, n instants. Axes of each side are those of the wing, mirrored at the body's plane for the upper one
    (Armanini et al. 2016, Eqs. 2, 8, 18).

    Attributes:
        along, normal: velocity of the wing through the air along its chord and normal to it, m/s.
        speed: magnitude of this velocity, m/s, never zero.
        circulation: Gamma, m^2/s, without that of fling (:meth:`StationedWings.forces` adds it); its force per length
            is -rho Gamma (normal, -along), rho being the density of the air.
    """

    along: Array
    normal: Array
    speed: Array
    circulation: Array


@dataclass(frozen=True)
class StationedWings:
    """Wings of B individuals with prescribed motion, at eight stations and n instants (Armanini et al. 2016).

    Attributes:
        places: the stations as described.
        chord: [B, 8], m.
        length: [B], factor on the length of the wings, which the rows of ``sides`` have already.
        sides: for each side that is computed (lower, upper), the motion [B, 14, n] of its wings (rows as in
            :mod:`wingfit.sim.vehicle.elements`) and the stream relative to them.
        turning: [B, n], rad/s: C_R theta_w' of Eq. 2 at the pitch station, for a wing without another one near it.
        fling: [B, n], rad/s: rate to add to ``turning`` while two wings peel apart (Eq. 7).
        loading: [B, 8]: factor on the circulation.
        density: [B] of the air, kg/m^3.
        lift: [B, 2]: C_l of the sine law and the factor on the measured lift curve.
        drag: [B, 3]: C_D0, C_Dpi2 and the factor on the measured drag curve.
        alike: number of wings per computed side, all with the same forces.
    """

    places: Stations
    chord: Array
    length: Array
    sides: tuple[tuple[Array, Side], ...]
    turning: Array
    fling: Array
    loading: Array
    density: Array
    lift: Array
    drag: Array
    alike: float

    def every(self, k: int) -> StationedWings:
        """The same wings at every ``k``-th instant only, starting with the first."""
        sides = tuple((rows[:, :, ::k].copy(), side) for rows, side in self.sides)
        return replace(self, sides=sides, turning=self.turning[:, ::k].copy(), fling=self.fling[:, ::k].copy())

    @cached_property
    def turns(self) -> tuple[Array, Array]:
        """Cosine and sine of the wing's pitch at the stations, [B, n, 8] each."""
        cosine, sine = np.empty((2, *self.turning.shape, STATIONS))
        stations.station_turns(self.sides[0][0], cosine, sine)
        return cosine, sine

    @cached_property
    def rotation(self) -> Array:
        """Quasi-steady circulation [B, n, 8] due to pitching, m^2/s, which :meth:`flow` includes in its circulation."""
        return self._turned(self.turning)

    @cached_property
    def flung(self) -> Array:
        """Circulation [B, n, 8] due to fling, m^2/s, which that of :meth:`flow` does not include."""
        return self._turned(self.fling)

    def flow(self, forward: Array) -> Flow:
        """Quasi-steady flow at the stations in a stream of ``forward`` [B, n] (m/s) along body x, set in ``sides``."""
        flow = Flow(*np.empty((4, len(self.sides), *self.turning.shape, STATIONS)))
        for k, (rows, side) in enumerate(self.sides):
            rows[:, FORWARD] = forward
            stations.station_velocities(rows, side, self.places.r, *self.turns, flow.along[k], flow.normal[k])
        self._circulate(flow)
        return flow

    def gust(self, flow: Flow, air: Array) -> None:
        """Update ``flow``, in place, for air that moves at ``air`` [sides, B, n, 8] (m/s) in the flapping direction."""
        for k, moved in enumerate(air):
            stations.station_gust(*self.turns, moved, flow.along[k], flow.normal[k])
        self._circulate(flow)

    def blow(self, flow: Flow, air: Array) -> None:
        """Update ``flow``, in place, for an additional stream of ``air`` [B, n, 8] (m/s) along body x."""
        cosine, sine = self.turns
        flow.along += air * sine
        flow.normal += air * cosine
        self._circulate(flow)

    def forces(self, flow: Flow) -> Array:
        """Circulatory (fling included) and viscous forces [B, 2, n] (N) of all wings in ``flow`` along body x and z."""
        out = np.zeros((len(self.turning), 2, self.turning.shape[1]))
        circulation, weight = flow.circulation + self.flung, self.places.weight
        for k, (rows, side) in enumerate(self.sides):
            moving = (flow.along[k], flow.normal[k], flow.speed[k], circulation[k])
            stations.station_forces(rows, side, *self.turns, *moving, weight, self.chord, self.density, self.drag, out)
        out *= (self.alike * self.length)[:, None, None]
        return out

    def normal_force(self, flow: Flow) -> Array:
        """Force per length [sides, B, n, 8] (N/m) by circulation (fling included) and drag, along the wings' normal."""
        friction = np.empty_like(flow.normal)
        for k, out in enumerate(friction):
            moving = flow.along[k], flow.normal[k], flow.speed[k]
            stations.station_friction(*moving, self.chord, self.drag, out)
        carried = (flow.circulation + self.flung) * flow.along
        return np.asarray(self.density[:, None, None] * (carried - friction * flow.normal))

    def _turned(self, rate: Array) -> Array:
        """Circulation [B, n, 8] (m^2/s) at the stations by a ``rate`` [B, n] (rad/s) at the pitch station (Eq. 2)."""
        lever = 0.5 * self.chord**2 * self.places.twist * self.loading
        return np.asarray(rate[:, :, None] * lever[:, None])

    def circulation(self, along: Array, normal: Array) -> tuple[Array, Array]:
        """Speed (m/s) and quasi-steady circulation (m^2/s) at velocities ``along`` and ``normal`` (m/s), as in Flow."""
        places, speed, found = self.places, np.empty_like(along), np.empty_like(along)
        for k in range(len(self.sides)):
            velocity, wing = (along[k], normal[k]), (places.twist, self.chord, self.loading)
            stations.station_circulation(*velocity, self.turning, self.lift, *wing, speed[k], found[k])
        return speed, found

    def _circulate(self, flow: Flow) -> None:
        """Set ``flow.speed`` and the quasi-steady ``flow.circulation`` from ``flow.along`` and ``flow.normal``."""
        flow.speed, flow.circulation = self.circulation(flow.along, flow.normal)
