"""The scene of a wing: the input of its simulation, LANES individuals at a time, which effects change."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from wingfit.records import Condition
from wingfit.records.array_types import Array, Index
from wingfit.sim.atmosphere import density
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import Lanes, Laws, Setting
from wingfit.sim.kernels.lanes.memory import aligned
from wingfit.sim.kernels.laws import Law, address
from wingfit.sim.solver.scene import setting
from wingfit.sim.wing.drive import RodDrive
from wingfit.sim.wing.planform import carriers
from wingfit.sim.wing.structure import Structure

_SEA_LEVEL, _LEAST_SCALE = 1.2, 1e-3  # kg/m^3; fraction
_LEAST_STROKE = 0.01  # rad, for a drive that does not move


@dataclass
class WingScene:
    """Input of the kernels for one group of W individuals of a wing under a condition. Effects change it in place.

    In each individual of the group the same effects are on. ``lanes``: stiffness, damping, coefficients, distribution
    of lift and drag, and hinge (:class:`wingfit.sim.kernels.arrays.Lanes`), whose values effects may change.
    ``density`` [W] (kg/m^3) and ``wind`` [3, W] (m/s) of the stream. ``rods``: motion of the driving rods; ``motor``
    [MOTOR, W] or empty: a compliant drive (:mod:`wingfit.sim.kernels.motor`). The methods add masses and laws.
    """

    structure: Structure
    condition: Condition
    lanes: Lanes
    rods: RodDrive
    density: Array
    wind: Array
    motor: Array = field(default_factory=lambda: np.zeros((0, LANES)))
    _weights: dict[int, Array] = field(default_factory=dict)
    _air: dict[tuple[int, int], Array] = field(default_factory=dict)
    _strip: list[list[int]] = field(default_factory=list)
    _connector: list[list[int]] = field(default_factory=list)
    _point: list[list[int]] = field(default_factory=list)
    _bodies: list[int] = field(default_factory=list)
    _arms: list[Array] = field(default_factory=list)
    _parameters: list[Array] = field(default_factory=list)
    _axes: list[int] = field(default_factory=list)
    _sizes: list[Array] = field(default_factory=list)

    @classmethod
    def of(cls, structure: Structure, condition: Condition, lanes: Lanes) -> WingScene:
        """Return the scene of a wing without effects."""
        here = setting(condition, 1)
        rods = RodDrive.of(structure.wing.drive, condition.phase_lag, LANES)
        return cls(structure, condition, lanes, rods, here.density, here.wind)

    @property
    def angular_rate(self) -> float:
        """2 pi times the flap frequency, rad/s."""
        return 2 * np.pi * self.condition.flap_frequency

    def body_at(self, station: Array, fraction: Array) -> tuple[Index, Array]:
        """Return the bodies [W] at positions on the wing, and the positions [W, 3] (m) from the bodies' mass centres.

        ``station`` [W]: fraction of the span from root to tip; ``fraction`` [W]: of the chord from the leading edge.
        """
        planform, wing = self.structure.planform, self.structure.wing
        y = wing.stations[0].y + station * wing.span
        x = planform.leading_edge(y) + fraction * planform.chord(y)
        body = carriers(self.structure.panels, y, fraction)
        centre = np.array([self.structure.bodies[n].centre for n in body])
        return body, np.stack([x, y, np.zeros_like(x)], axis=1) - centre

    def add_mass(self, body: int, mass: Array, first_moment: Array, second_moment: Array) -> None:
        """Add to body number ``body`` a ``mass`` [W] (kg) with its first moment [3, W] and its inertia [3, 3, W].

        Both moments (kg m, kg m^2) are about the body's centre of mass, in its frame. To shift mass within a body, give
        a ``mass`` of zero.
        """
        block = np.zeros((6, 6, LANES))
        skew = np.zeros((3, 3, LANES))
        x, y, z = first_moment
        skew[0, 1], skew[0, 2], skew[1, 2] = -z, y, -x
        skew -= np.swapaxes(skew, 0, 1)
        block[:3, :3], block[:3, 3:], block[3:, :3] = second_moment, skew, -skew
        block[[3, 4, 5], [3, 4, 5]] = mass
        self._weights[body] = self._weights.get(body, 0.0) + block

    def add_point_mass(self, body: int, mass: Array, place: Array) -> None:
        """Add a point of ``mass`` [W] (kg) to body number ``body``, at ``place`` [3, W] (m) from its centre of mass."""
        square = np.eye(3)[:, :, None] * (place**2).sum(axis=0) - place[:, None] * place[None]
        self.add_mass(body, mass, mass * place, mass * square)

    def add_air(self, first: int, second: int, block: Array) -> None:
        """Add ``block`` [6, 6, W] to the matrix of added mass between the bodies ``first`` and ``second`` of one strip.

        Rows are moment and force on ``first``, columns rotation and translation of ``second``. For two different bodies
        add both orders, each the transpose of the other. Air moves along the normal: only the rows and columns of
        rotation about x and y and of translation along z are used.
        """
        self._air[first, second] = self._air.get((first, second), 0.0) + block

    def add_strip_law(
        self, law: Law, parameters: list[Array], states: list[float] | None = None, *, before: bool = False
    ) -> None:
        """Let the compiled ``law`` of the air act on each of S strips, after their flow is known.

        ``parameters``: those of the law in its order, [W] or [S, W] each. ``states``: for each internal state of the
        law a factor that converts it to metres of motion at sea level, for the search for the periodic motion; in
        thinner air the factor is reduced in proportion to the density. With ``before`` the law is also called before
        the flow is known.
        """
        scale = max(density(self.condition.pressure, self.condition.temperature) / _SEA_LEVEL, _LEAST_SCALE)
        sizes = [size * min(scale, 1.0) for size in states or []]
        self._add(self._strip, len(self.structure.wiring.geometry), law, parameters, sizes)
        self._strip[-1][5] = int(before)

    def add_connector_law(
        self, law: Law, parameters: list[Array], axes: list[int] | None = None, states: list[float] | None = None
    ) -> None:
        """Let the compiled ``law`` act on each of C connectors; ``parameters``: [W] or [C, W] each.

        ``axes``: for each state, the axis of its wrench: 0 to 2 rotation about x, y, z of the first body, 3 to 5
        translation; ``states``: for each state, a factor that converts it to metres.
        """
        self._add(self._connector, len(self.structure.connectors), law, parameters, states or [])
        self._connector[-1][5] = len(self._axes)
        self._axes += axes or []

    def add_point_law(self, law: Law, station: Array, fraction: Array, parameters: list[Array]) -> None:
        """Let ``law`` apply a wrench at a position on the wing, given as in :meth:`body_at`; ``parameters`` [W] each.

        Where the position lies on different bodies in different individuals, each of these bodies has a point, with
        parameters of zero in the other individuals.
        """
        found, arms = self.body_at(station, fraction)
        bodies = np.unique(found)
        here = found == bodies[:, None]
        self._add(self._point, len(bodies), law, [np.where(here, values, 0.0) for values in parameters], [])
        self._point[-1][2:] = [len(bodies), self._point[-1][3], len(self._bodies)]
        self._bodies += bodies.tolist()
        self._arms += [np.where(lanes, arms.T, 0.0) for lanes in here]

    def at_rest(self, station: Array, fraction: Array) -> Array:
        """Return the world coordinates [3, W] (m) at rest of positions on the wing, given as in :meth:`body_at`."""
        found, arms = self.body_at(station, fraction)
        return np.asarray((arms + np.array([self.structure.bodies[n].centre for n in found])).T)

    def _add(self, laws: list[list[int]], places: int, law: Law, parameters: list[Array], states: list[float]) -> None:
        at, first = sum(map(len, self._parameters)), sum(map(len, self._sizes))
        laws.append([address(law), len(parameters), len(states), at, first, 0])
        self._parameters += [np.broadcast_to(values, (places, LANES)) for values in parameters]
        self._sizes += [np.full(places, size) for size in states]

    @property
    def _motor_sizes(self) -> Array:
        """Factors that convert the states of a compliant motor to metres: a lead (s) times the speed of the tip."""
        wing = self.structure.planform.wing
        stroke = np.abs(RodDrive.of(wing.drive, 0.0, 1).series[1:]).sum()  # as described: the same for every individual
        lead = wing.stations[-1].y * self.angular_rate * max(stroke, _LEAST_STROKE)
        return np.array([lead, lead / self.angular_rate, 1e-3] if len(self.motor) else [])

    def frozen(self) -> Lanes:
        """Return the inputs of the kernels, with all added masses and laws."""
        solid = sorted(self._weights)
        pairs = [(n, n, n) for n in solid]
        pairs += [(i, j, self.structure.position[i, j]) for i, j in sorted(self._air)]
        blocks = [self._weights[n] for n in solid] + [self._air[pair] for pair in sorted(self._air)]
        laws = Laws(
            strip=np.array(self._strip, np.int64).reshape(-1, 6),
            connector=np.array(self._connector, np.int64).reshape(-1, 6),
            point=np.array(self._point, np.int64).reshape(-1, 5),
            axes=np.array(self._axes, np.int64),
            bodies=np.array(self._bodies, np.int64),
            arms=aligned(np.array(self._arms).reshape(-1, 3, LANES)),
            parameters=aligned(np.concatenate([*self._parameters, np.zeros((0, LANES))])),
            size=np.concatenate([*self._sizes, self._motor_sizes]),
            motor=aligned(self.motor),
        )
        return self.lanes._replace(
            pairs=np.array(pairs, np.int64).reshape(-1, 3),
            masses=aligned(np.array(blocks).reshape(-1, 36, LANES)),
            weighing=len(solid),
            laws=laws,
        )

    def setting(self, steps: int) -> Setting:
        """Return the condition as input of the kernels, with ``steps`` per beat and this scene's density and wind."""
        return setting(self.condition, steps)._replace(density=aligned(self.density), wind=aligned(self.wind))
