"""Build the arrays of a simulation from a wing, its genes and a condition.

Hidden effects change an intermediate :class:`Draft`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.wing.geometry import Cut, Lump
from benchmarks.concealed.plant.wing.integrator import C
from benchmarks.concealed.plant.wing.joints import Joint, joints, shares
from benchmarks.concealed.plant.wing.linkage import series_of
from benchmarks.concealed.plant.wing.rig import AIR_LAWS, JETS, LAG, POINTS, STALL, Rig
from wingfit.records import Condition, Drive, Wing

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

GAS = 287.05  # J/(kg K), dry air


@dataclass
class Draft:
    """A wing under a condition, before its simulation. Hidden effects change it in place.

    Attributes:
        wing, genome, condition: what is simulated; ``division``: its bodies, as in :func:`.geometry.counts_of`.
        lumps: additional point masses; to be added before :meth:`cut_up`, which divides the wing, like ``aft`` (m), as
            in :class:`.geometry.Cut`.
        cut, joints: the divided wing and its C joints.
        factor: [C] factor on stiffness and damping of each joint.
        hardening, play: [C], as in :class:`.rig.Rig`, like ``air_laws``, ``jets``, ``hinge`` and ``axle``.
        memory: joints with an internal state: (joint, axis, kind, stiffness, parameter), as in ``Rig.memory``.
        points: loads at one point: (body, row of ``Rig.points``).
        rods: [K, 2] complex Fourier series of the angles of the front and rear driving rod, rad.
        motor: loss of speed per power (1/W) and time constant (s) of a compliant drive; 0 for a stiff one.
        lead: [K] complex Fourier series of the angle by which the crank leads uniform rotation, rad.
    """

    wing: Wing
    division: str
    genome: Mapping[str, float]
    condition: Condition
    lumps: list[Lump] = field(default_factory=list)
    aft: float = 0.0
    motor: tuple[float, float] = (0.0, 0.0)
    lead: Complex = field(default_factory=lambda: np.zeros(1, np.complex128))
    memory: list[tuple[int, int, float, float, float]] = field(default_factory=list)
    jets: list[list[float]] = field(default_factory=list)
    points: list[tuple[int, list[float]]] = field(default_factory=list)
    air_laws: Array = field(default_factory=lambda: np.zeros(AIR_LAWS))

    def cut_up(self) -> None:
        """Divide the wing, with its ``lumps``, into bodies and joints, and set the attributes that depend on them."""
        self.cut = Cut(self.wing, self.division, self.lumps, self.aft)
        self.joints: list[Joint] = joints(self.cut, self.genome)
        count = len(self.joints)
        self.factor, self.hardening, self.play = np.ones(count), np.zeros(count), np.zeros(count)
        self.rods = self.series(self.wing.drive)
        self.hinge = np.array([0.0, self.wing.hinge.y, self.wing.hinge.z])
        self.axle = np.array([1.0, 0.0, 0.0])

    @property
    def span(self) -> float:
        """Span from root to tip, m."""
        return float(self.cut.edges[-1] - self.cut.edges[0])

    def series(self, drive: Drive) -> Complex:
        """[K, 2] Fourier series of the angles (rad) of the front rod, and of the rear rod, which lags by phase_lag."""
        one = series_of(drive)
        return np.stack([one, one * np.exp(-1j * self.condition.phase_lag * np.arange(len(one)))], axis=1)

    def curvature(self, joint: Joint) -> float:
        """Ratio of span to ``joint.length``, which converts the joint's angle to an angle over the whole span."""
        return self.span / joint.length

    def at(self, span: float, chord: float) -> tuple[int, Array, Array]:
        """Body at a position (fractions of span and chord), and the position from its centre and in the wing frame.

        Both positions [3], m, at rest.
        """
        x, y = self.cut.place(span, chord)
        body = int(self.cut.under(x, y)[0])
        place = np.array([x, y, 0.0])
        return body, place - self.cut.bodies[1][body], place


def rig_of(draft: Draft) -> Rig:
    """Convert ``draft`` to the arrays of the compiled simulation."""
    cut, condition = draft.cut, draft.condition
    mass, centre, inertia = cut.bodies
    found, n = draft.joints, len(mass)
    first = np.array([j.first if j.first >= 0 else n - 1 - j.first for j in found], np.int64)
    second = np.array([j.second for j in found], np.int64)
    points = np.array([j.point for j in found])
    frames = np.concatenate([centre, [draft.hinge, draft.hinge]])
    genome, incidence = draft.genome, condition.angle_of_attack
    area = np.add.reduceat(cut.area, cut.start[:-1])
    memory = np.array([row[2:] for row in draft.memory]).reshape(-1, 3)
    near = [abs(int(i) - int(j)) for i, j in zip(first, second, strict=True) if i < n]
    return Rig(
        mass=mass,
        inertia=inertia,
        rest=centre,
        first=first,
        second=second,
        a=points - frames[first],
        b=points - centre[second],
        stiffness=np.array([j.stiffness for j in found]) * draft.factor[:, None],
        damping=np.array([j.damping for j in found]) * draft.factor[:, None],
        bends=np.array([0 if j.along_span else 1 for j in found], np.int64),
        curvature=np.array([draft.curvature(j) for j in found]),
        hardening=draft.hardening,
        play=draft.play,
        memory_of=np.array([row[0] for row in draft.memory], np.int64),
        memory_axis=np.array([row[1] for row in draft.memory], np.int64),
        memory=memory,
        strip=cut.start,
        weight=cut.area / area[cut.strip],
        centroid=cut.centroid - centre[:, :2],
        area=area,
        chord=area / np.diff(cut.edges),
        coefficients=np.array([genome[name] for name in ("L_a", "L_b", "ID_a", "ID_b")]),
        lift=shares(cut, genome, "L"),
        drag=shares(cut, genome, "ID"),
        air=condition.pressure / (GAS * condition.temperature),
        wind=condition.airspeed * np.array([np.cos(incidence), 0.0, np.sin(incidence)]),
        gravity=float(condition.gravity),
        air_laws=draft.air_laws,
        remembers=int(draft.air_laws[LAG] > 0 or draft.air_laws[STALL] > 0),
        jets=np.array(draft.jets).reshape(-1, JETS),
        points=np.array([row for _, row in draft.points]).reshape(-1, POINTS),
        point_body=np.array([body for body, _ in draft.points], np.int64),
        hinge=draft.hinge,
        axle=draft.axle,
        period=1.0 / condition.flap_frequency,
        reach=max(*near, max(cut.counts) - 1),
    )


def rod_table(draft: Draft, steps: int) -> Array:
    """[steps + 1, STAGES, 2 rods, 2]: angle (rad) and rate (rad/s) of both rods at all integrator stages of a beat."""
    psi, pace = 2 * np.pi * (np.arange(steps + 1)[:, None] + C) / steps, 1.0
    if draft.lead.any():
        k = np.arange(len(draft.lead))
        turn = np.exp(1j * psi[..., None] * k)
        psi, pace = psi + (turn @ draft.lead).real, 1.0 + (turn @ (1j * k * draft.lead)).real[..., None]
    k = np.arange(len(draft.rods))
    turn = np.exp(1j * psi[..., None] * k)
    angle, slope = (turn @ draft.rods).real, pace * (turn @ (1j * k[:, None] * draft.rods)).real
    return np.ascontiguousarray(np.stack([angle, 2 * np.pi * draft.condition.flap_frequency * slope], axis=-1))
