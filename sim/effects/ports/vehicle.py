"""The scene of a vehicle: the input of its simulation, which effects change."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from wingfit.records import Condition, Vehicle, WingMotion
from wingfit.records.array_types import Array, Complex
from wingfit.sim.atmosphere import density
from wingfit.sim.vehicle.elements import FLAP_ACCELERATION, FLAP_RATE, PEELED, PITCH_RATE, PROJECTION, Side
from wingfit.sim.vehicle.flow import Flow, StationedWings
from wingfit.sim.vehicle.motion import Angles, PitchError, angles_of, flap_series
from wingfit.sim.vehicle.rows import mirrored, motion_rows, set_side, uppers
from wingfit.sim.vehicle.states import followed
from wingfit.sim.vehicle.stations import STATIONS, Stations, span_sums, stations

ROTATION_POINT = 0.75  # Eq. 4
TWIST_INSTANTS, TWIST_ROUNDS = 80, 20  # of a twist that changes the flow by which it arises
SETTLED = 1e-3  # rad: a twist that still changes by more has no solution near, or several
RELAXATION, MEMORY, SMALLEST = 0.5, 5, 1e-12  # of the rounds: step, how many count, damping
# Stages of a scene, in order: each reads what the stages before have changed.
Stage = Literal["twist", "mass", "inflow", "wake", "circulation"]
Change = Callable[["VehicleScene", Mapping[str, Array]], None]


def _mixed(tried: Sequence[Complex], rests: Sequence[Complex]) -> Complex:
    """Return the next iterate [B, K] after those ``tried`` with the residuals ``rests``, oldest first (Anderson).

    Walker and Ni (2011), SIAM J. Numer. Anal. 49, 1715, Eq. 2.2 with a relaxation: least squares of the residual.
    """
    step = tried[-1] + RELAXATION * rests[-1]
    if len(tried) == 1:
        return step
    changes, moves = (np.diff(np.stack(one, axis=-1)) for one in (rests, tried))  # [B, K, m]
    square = np.sum((changes.conj()[..., :, None] * changes[..., None, :]).real, axis=1)
    along = np.sum((changes.conj() * rests[-1][..., None]).real, axis=1)
    size = np.trace(square, axis1=1, axis2=2)[:, None, None]
    share = np.linalg.solve(square + (SMALLEST * size + 1e-300) * np.eye(square.shape[1]), along[..., None])[
        :, None, :, 0
    ]
    return np.asarray(step - np.sum((moves + RELAXATION * changes) * share, axis=2))


@dataclass(frozen=True)
class Setting:
    """Inputs that all individuals share: the vehicle, its condition, and the resolution of a beat.

    ``terms``: names of the model's terms that are on (:mod:`wingfit.sim.vehicle.terms`); ``motion``: that of the
    recording or, without one, of the vehicle; ``instants``: number n of instants in a beat; ``peel_width``: time
    (beats) in which rotational circulation replaces fling circulation; ``r`` [E]: middles of the wing's elements, m
    from the flapping axis.
    """

    vehicle: Vehicle
    terms: tuple[str, ...]
    motion: WingMotion
    condition: Condition
    instants: int
    peel_width: float
    r: Array


def deferred(stage: Stage, change: Change) -> Change:
    """Return the ``change`` of a scene, deferred to ``stage``, after all effects have made their immediate changes."""
    return lambda scene, values: scene.after(stage, lambda: change(scene, values))


@dataclass
class VehicleScene:
    """B individuals of one vehicle in one condition. Effects change this object in place.

    Effects set drive, stream, mass and loading at once, in the order of the registry. Changes that depend on these or
    on the flow are deferred to their stage (:meth:`after`). A beat has n instants, a wing E elements; t* is the time in
    beats.

    Attributes:
        setting: shared by all individuals.
        genes: coefficients and parameters of the motion by name, [B]; zero for a term that is off.
        flap: series [B, K + 1] of the flap angle in rad, Re sum_k flap_k exp(2 pi i k t*).
        airspeed: [B], m/s.
        incidence: [B], rad: angle between the stream and the body (body pitch in level flight).
        density: [B] of the air, kg/m^3.
        mass_factor: [B], factor on the mass of the wings per length.
        length, chord: [B], factors on radius and width of the wings' elements, and on their chord.
        behind: [B]: distance, in chords, by which the wings lie further behind their axis of pitch than described.
        inflow: [B, n], m/s: added to the stream along body x over the beat.
        loading: [B, E + 8]: factor on the circulation at the E elements, then at the eight stations.
        fling: [B]: coefficient C of an additional circulation 1/2 C c^2 (-theta_w') while the wings peel apart (chord
            c, wing pitch theta_w).
        added: [B, 2, n]: forces of all wings along body x and z besides those of the model's terms, N.
        included: names of forces of the elements (:data:`wingfit.sim.vehicle.elements.ROWS`) that effects add to those
            of the model's terms, each with the name of its coefficient in ``genes``.
        together: [B]: how much of the chord that has not come apart yet (:attr:`Angles.peeled`) carries no added mass;
            1: all of it, 0: none.
        carried: [B]: factor on the mass of the air that a wing accelerates.
        pitch: errors of the described wing pitch.
    """

    setting: Setting
    genes: Mapping[str, Array]
    flap: Complex
    airspeed: Array
    incidence: Array
    density: Array
    mass_factor: Array
    length: Array
    chord: Array
    behind: Array
    inflow: Array
    loading: Array
    fling: Array
    added: Array
    together: Array
    carried: Array
    pitch: PitchError
    included: dict[str, str] = field(default_factory=dict)
    _waiting: dict[Stage, list[Callable[[], None]]] = field(default_factory=dict, repr=False)
    _base: Array | None = field(default=None, repr=False)

    @classmethod
    def of(cls, setting: Setting, genes: Mapping[str, Array], count: int) -> VehicleScene:
        """Return the scene of ``count`` individuals without effects, from their ``genes`` [count] by name."""
        air, n = setting.condition, setting.instants
        flap = flap_series(setting.motion.flap, genes, count, n)
        if len(flap) < count:
            flap = np.repeat(flap, count, axis=0)
        airspeed, incidence = np.full(count, air.airspeed), np.full(count, air.angle_of_attack)
        rho = np.full(count, density(air.pressure, air.temperature))
        loading = np.ones((count, len(setting.r) + STATIONS))
        inflow, added = np.zeros((count, n)), np.zeros((count, 2, n))
        together = np.full(count, float("effective_chord" in setting.terms))
        one, none = np.ones(count), np.zeros(count)
        return cls(
            setting=setting, genes=genes, flap=flap, airspeed=airspeed, incidence=incidence, density=rho,
            mass_factor=one, length=one, chord=one, behind=none, inflow=inflow, loading=loading, fling=none,
            added=added, together=together, carried=one, pitch=PitchError(none, none, none),
        )  # fmt: skip

    def __len__(self) -> int:
        """Number of individuals B."""
        return len(self.flap)

    @property
    def step(self) -> float:
        """Time between instants, s."""
        return 1.0 / (self.setting.condition.flap_frequency * self.setting.instants)

    def after(self, stage: Stage, action: Callable[[], None]) -> None:
        """Defer ``action`` to ``stage``, after all effects have made their immediate changes."""
        self._waiting.setdefault(stage, []).append(action)

    def settle(self) -> None:
        """Run the deferred actions, stage by stage in the order of ``Stage``."""
        for stage in get_args(Stage):
            for action in self._waiting.pop(stage, []):
                action()

    # -- for effects of the drive ------------------------------------------------------------------------------

    def add_harmonic(self, k: int, coefficient: Complex) -> None:
        """Add Re coefficient exp(2 pi i k t*) to the flap angle; ``coefficient`` [B], rad."""
        if self.flap.shape[1] <= k:
            self.flap = np.pad(self.flap, ((0, 0), (0, k + 1 - self.flap.shape[1])))
        self.flap[:, k] += coefficient

    @cached_property
    def angles(self) -> Angles:
        """Motion of the wings (flap angle, pitch, peeling); the flap angle is read-only after the first access."""
        self.flap.setflags(write=False)
        own, frequency = self.setting, self.setting.condition.flap_frequency
        about = own.instants, own.vehicle.claps, own.peel_width
        return angles_of(self.flap, own.motion, self.genes, frequency, *about, self.pitch)

    def twist(self, law: Callable[[StationedWings, Flow], Array], harmonics: int) -> None:
        """Add to the wing's pitch the angle (rad) that ``law`` computes [B, m] from the flow, which that angle changes.

        ``law`` has the wings at every few instants, m of them, in quasi-steady flow. ``harmonics``: of the angle. NaN
        where the iteration does not converge, so that the forces are not finite.
        """
        count = self.setting.instants
        harmonics = min(harmonics, (count - 1) // 2)
        every = max(k for k in range(1, max(count // TWIST_INSTANTS, 1) + 1) if count % k == 0)
        angle, tried, rests = np.zeros((len(self), harmonics + 1), complex), list[Complex](), list[Complex]()
        for _ in range(TWIST_ROUNDS):
            wings = self._twisted(angle).wings.every(every)
            found = law(wings, wings.flow(self.forward(self.inflow)[:, ::every]))
            target = np.fft.rfft(found)[:, : harmonics + 1] * (2.0 / found.shape[1])
            target[:, 0] *= 0.5
            tried, rests = [*tried[-MEMORY:], angle], [*rests[-MEMORY:], target - angle]
            angle = _mixed(tried, rests)
        angle[np.abs(rests[-1]).sum(axis=1) > SETTLED] = np.nan
        self.pitch = self.pitch._replace(more=angle)

    def _twisted(self, angle: Complex) -> VehicleScene:
        """Return a copy whose wings have the pitch ``angle`` [B, K + 1] (rad) besides their own."""
        own = {name: getattr(self, name).copy() for name in ("flap", "airspeed", "density", "loading", "fling")}
        return replace(self, pitch=self.pitch._replace(more=angle), _waiting={}, **own)

    # -- for effects that are terms of other models -----------------------------------------------------------------

    def include(self, row: str, coefficient: Array, gene: str = "") -> None:
        """Add ``coefficient`` [B] times the forces of the elements called ``row``, as if the model had that term.

        ``gene``: name of the term's coefficient, from which the flow at the stations is computed too; "" for none.
        """
        name = gene or row
        self.genes = {**self.genes, name: self.genes.get(name, 0.0) + coefficient}
        self.included[row] = name

    # -- for effects of the loading ----------------------------------------------------------------------------

    @cached_property
    def stations(self) -> Stations:
        """The eight stations along each wing at which effects of the flow act."""
        return stations(self.setting.vehicle, self.setting.motion)

    @property
    def span(self) -> Array:
        """Length [B] of a wing, m."""
        return np.asarray(self.length * self.setting.vehicle.span)

    @property
    def chords(self) -> Array:
        """Chords [B, 8] at the stations, m."""
        return np.asarray(self.chord[:, None] * self.stations.chord)

    def load(self, law: Callable[[Array], Array]) -> None:
        """Multiply the circulation by ``law``, a factor [B, m] at m distances (m) from the flapping axis."""
        self.loading *= law(np.concatenate([self.setting.r, self.stations.r]))

    # -- for effects of the flow -------------------------------------------------------------------------------

    @cached_property
    def wings(self) -> StationedWings:
        """The wings at eight stations; flap angle, airspeed, density, loading and fling are read-only afterwards."""
        own = self.setting.vehicle
        for read in (self.airspeed, self.density, self.loading, self.fling):
            read.setflags(write=False)
        rows = self.rows(float(self.stations.twist[0]))
        sides = tuple((rows.copy(), side) for side in self.each_side(rows))
        lift, drag = self._coefficients("C_l", "K_l"), self._coefficients("C_D0", "C_Dpi2", "K_d")
        loading = self.loading[:, -STATIONS:].copy()
        turning, fling = self._turning()
        return StationedWings(
            self.stations,
            self.chords,
            self.length,
            sides,
            turning,
            fling,
            loading,
            self.density.copy(),
            lift,
            drag,
            mirrored(own),
        )

    @cached_property
    def flow(self) -> Flow:
        """The flow at the stations, which effects change; the inflow is read-only after the first access."""
        self.inflow.setflags(write=False)
        flow = self.wings.flow(self.forward(self.inflow))
        self._base = self.wings.forces(flow)
        return flow

    def follow(self, share: Array, target: Array) -> Array:
        """Return the periodic solution x of x' = share V (target - x), where V is the speed of the flow.

        ``share`` [B, 8], 1/m; ``target`` and x [sides, B, n, 8] as in the flow.
        """
        out = np.empty_like(target)
        followed(self.flow.speed, share, target, self.step, out)
        return out

    def over_span(self, values: Array, weight: Array) -> Array:
        """Return the sum over eight stations [B, n] of ``values`` [B, n, 8] times ``weight`` [8]."""
        out = np.empty(values.shape[:2])
        span_sums(values, weight, out)
        return np.asarray(self.length[:, None] * out)

    def push(self, x: Array, z: Array) -> None:
        """Add a force (N) of every wing to the vehicle.

        ``x`` [B, n]: along body x; ``z`` [B, n]: along z of the wing's side (lower or upper), projected by the
        dihedral.
        """
        for rows, side in self.wings.sides:
            self.added[:, 0] += self.wings.alike * x
            self.added[:, 1] += self.wings.alike * side.sign * rows[:, PROJECTION] * z

    def push_behind(self, accelerated: Array, turned: Array) -> None:
        """Add the forces -m a of a mass m at a distance e behind the axis of pitch of every wing, to the vehicle.

        a is the acceleration of the vector -e (sin theta, cos theta) from the axis to the mass in body x and z, with
        theta the pitch of the wing. ``accelerated`` and ``turned`` [B, n or 1, 8], kg: m e per length of span, for the
        parts with theta'' and with theta'^2.
        """
        places, (cosine, sine), pitch = self.stations, self.wings.turns, self.angles.pitch[:, :, :, None]
        along, inward = accelerated * pitch[:, 2] * places.twist, turned * (pitch[:, 1] * places.twist) ** 2
        x, z = along * cosine - inward * sine, -along * sine - inward * cosine
        self.push(self.over_span(x, places.weight), self.over_span(z, places.weight))

    def push_along_chord(self, force: Array) -> None:
        """Add a ``force`` [sides, B, n, 8] (N/m) towards the leading edge of every wing to the vehicle."""
        cosine, sine = self.wings.turns
        weight, alike = self.stations.weight, self.wings.alike
        for (rows, side), along in zip(self.wings.sides, force, strict=True):
            self.added[:, 0] += alike * self.over_span(along * sine, weight)
            self.added[:, 1] += alike * side.sign * rows[:, PROJECTION] * self.over_span(along * cosine, weight)

    def carry(self, air: Array) -> None:
        """Add the forces on the added mass of every wing in air that moves at ``air`` [B, n, 8] (m/s) along body x.

        Those of a stream of that speed in Eqs. 9 to 14 of Armanini et al. (2016), with mirrored velocities, except
        along the chord, where the added mass is that of the wing's thickness. The wing's own mass does not move with
        the air, and the rate of change of ``air`` is neglected.
        """
        (cosine, sine), places, (rows, _) = self.wings.turns, self.stations, self.wings.sides[0]
        factor = self.apart(rows) ** 2 * rows[:, PITCH_RATE] * (0.25 * np.pi * self.carried * self.density)[:, None]
        force = factor[:, :, None] * air * self.chords[:, None] ** 2 * places.twist
        along, normal = self.share("inertial") * force * cosine, self.share("added_mass") * force * sine
        x, z = along * sine + normal * cosine, along * cosine - normal * sine
        self.push(self.over_span(x, places.weight), self.over_span(z, places.weight))

    @property
    def lever(self) -> Array:
        """Distance [B], in chords, of the point behind the axis of pitch whose velocity circulation by rotation has."""
        return np.asarray(ROTATION_POINT - self.setting.vehicle.pitch_axis + self.behind)

    def share(self, row: str) -> Array:
        """Return the factor [B, 1, 1] on the forces of the elements called ``row``, which has no coefficient."""
        own, more = float(row in self.setting.terms), self.included.get(row)
        return np.asarray(own + (self.genes[more] if more else np.zeros(len(self))))[:, None, None]

    # -- for the model -----------------------------------------------------------------------------------------

    def rows(self, half_step: float) -> Array:
        """Return the motion [B, 14, n] of the wing's elements, in the rows of :mod:`wingfit.sim.vehicle.elements`.

        The first element has the fraction ``half_step`` of the twist at the pitch station.
        """
        rows = motion_rows(self.angles, self.forward(self.inflow), self.setting.motion.root_pitch, half_step)
        rows[:, [FLAP_RATE, FLAP_ACCELERATION]] *= self.length[:, None, None]
        return rows

    def apart(self, rows: Array) -> Array:
        """Return the part [B, n] of the chord that carries added mass, from the motion ``rows`` [B, 14, n]."""
        peeled, together = rows[:, PEELED], self.together[:, None]
        return np.where(together == 0.0, 1.0, peeled + (1.0 - together) * (1.0 - peeled))

    def each_side(self, rows: Array) -> Iterator[Side]:
        """Yield each computed side: the lower wings, then the upper ones of a vehicle that has them (layout "x4").

        The motion ``rows`` [B, 14, n] is changed in place to that of the side.
        """
        below = self.airspeed * np.sin(self.incidence)
        for upper in uppers(self.setting.vehicle):
            yield set_side(rows, self.setting.vehicle, self._flap, below, upper)

    def finish(self) -> Array:
        """Return the forces [B, 2, n] (N, body x and z) that effects add: directly, and by changing the flow."""
        if self._base is None:
            return self.added
        return np.asarray(self.added + (self.wings.forces(self.flow) - self._base))

    def forward(self, inflow: Array) -> Array:
        """Return the speed of the stream [B, n] (m/s) along body x, including an ``inflow`` [B, n] (m/s)."""
        return np.asarray((self.airspeed * np.cos(self.incidence))[:, None] + inflow)

    @cached_property
    def _flap(self) -> tuple[Array, Array, Array]:
        """Cosine and sine of the flap angle, and its rate (rad/s), [B, n] each."""
        flap = self.angles.flap
        return np.cos(flap[:, 0]), np.sin(flap[:, 0]), flap[:, 1]

    def _turning(self) -> tuple[Array, Array]:
        """Return two rates [B, n] (rad/s) that replace C_R theta_w' in Eq. 2 of Armanini et al. (2016).

        They are those of rotation and of fling, at the pitch station. The term of the model replaces C_R by C_F while
        the wings peel (Eqs. 4, 7). Here C_R continues and C_F + C_R is added, which is the same unless rotation lags or
        stalls; fling between two wings does neither.
        """
        on, rate = float("clap_and_peel" in self.setting.terms), self.angles.pitch[:, 1]
        rotation, fling = self._coefficients("C_r", "C_F").T[:, :, None]
        turn = rotation * self.lever[:, None]
        more = (fling + turn) * on + self.fling[:, None]
        return np.asarray(turn * rate), np.asarray(-more * self.angles.peel * rate)

    def _coefficients(self, *names: str) -> Array:
        """Return the values [B, names] of the genes called ``names``; zero for terms that are off."""
        return np.stack([self.genes.get(name, np.zeros(len(self))) for name in names], axis=1)
