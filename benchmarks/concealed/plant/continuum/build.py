"""Builds the arrays of a wing as a rod (:class:`.beam.Beam`) from its description, its genes and a condition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.continuum.beam import STRAINS, Beam, Index
from benchmarks.concealed.plant.continuum.integrate import C
from benchmarks.concealed.plant.continuum.sections import Mass, Sections, x_of
from benchmarks.concealed.plant.wing.geometry import Lump
from benchmarks.concealed.plant.wing.rig import LAG, POINTS, SLIDER, STALL
from wingfit.records import Condition

Array = npt.NDArray[np.float64]

_GAS = 287.05  # J/(kg K), dry air
_SECTIONS = 3  # Gauss points of an element at which inertia and air act
_HELD = 1e-5  # length of the root that the driving rods hold, as a fraction of the span


@dataclass(frozen=True)
class Laws:
    """What else acts on the rod, and what is hidden in it.

    Attributes:
        steep: as in :class:`.beam.Beam`, like ``air_laws``, ``hinge`` and ``axle``.
        lumps: additional point masses.
        memory: springs with an internal state: (axis, kind, fraction of the stiffness, parameter), as in
            :class:`.beam.Beam`; for a slider the fraction is that of the rods' stiffness.
        points: loads at single points: place [3] in the wing frame, m, and row of ``Rig.points``.
        rods: [K, 2] complex Fourier series of the angles of the front and rear driving rod, rad.
    """

    steep: float
    air_laws: Array
    hinge: Array
    axle: Array
    lumps: Sequence[Lump]
    memory: Sequence[tuple[int, int, float, float]]
    points: Sequence[tuple[Array, Array]]
    rods: npt.NDArray[np.complex128]


def shape_functions(t: Array) -> tuple[Array, Array]:
    """Quadratic shape functions [len(t), 3] at ``t`` (-1 to 1 in the element), and their derivatives by ``t``."""
    return (
        np.stack([0.5 * t * (t - 1), 1 - t * t, 0.5 * t * (t + 1)], axis=1),
        np.stack([t - 0.5, -2 * t, t + 0.5], axis=1),
    )


class Mesh:
    """Division of the span into quadratic elements; their borders include all span positions with a jump.

    ``elements``: about how many, but at least one between any two of these positions.
    """

    def __init__(self, sections: Sections, elements: int) -> None:
        wanted = (sections.tip - sections.root) / elements
        borders = [sections.root]
        for a, b in pairwise(sections.borders):
            count = max(1, round((b - a) / wanted))
            borders += (a + (b - a) * np.arange(1, count + 1) / count).tolist()
        self.borders = np.array(borders)
        self.half = 0.5 * np.diff(self.borders)
        self.middle = 0.5 * (self.borders[1:] + self.borders[:-1])

    @property
    def nodes(self) -> Array:
        """[n] span positions of all nodes, m."""
        found = np.empty(2 * len(self.half) + 1)
        found[0::2], found[1::2] = self.borders, self.middle
        return found

    def gauss(self, count: int) -> tuple[Array, Array, Array]:
        """``count`` Gauss points in each element: their t [E count], span positions and weights (m)."""
        t, weights = np.polynomial.legendre.leggauss(count)
        y = self.middle[:, None] + self.half[:, None] * t
        return np.tile(t, len(self.half)), y.ravel(), (self.half[:, None] * weights).ravel()

    def locate(self, y: Array) -> tuple[Index, Array]:
        """Elements [M] that contain the span positions ``y`` [M] (m), and shape functions [M, 3] there."""
        e = np.clip(np.searchsorted(self.borders, y, side="right") - 1, 0, len(self.half) - 1).astype(np.int64)
        return e, shape_functions((y - self.middle[e]) / self.half[e])[0]


def beam_of(sections: Sections, mesh: Mesh, condition: Condition, laws: Laws) -> Beam:
    """Arrays of the wing with ``sections`` on the ``mesh`` under ``condition`` and ``laws``."""
    rest = np.array([sections.line(y) for y in mesh.nodes])
    t, y, length = mesh.gauss(STRAINS)
    shape, slope = shape_functions(t)
    slope /= np.repeat(mesh.half, STRAINS)[:, None]
    nodes = 2 * (np.arange(len(y)) // STRAINS)[:, None] + np.arange(3)
    rigidity = [sections.rigidity(at) for at in y]
    _, air_y, width = mesh.gauss(_SECTIONS)
    slices = [_scaled(sections.mass(at), w) for at, w in zip(air_y, width, strict=True)]
    extra = sections.points(laws.lumps)
    element, part = mesh.locate(np.array([*air_y, *(at for at, _ in extra)]))
    masses = [*slices, *(mass for _, mass in extra)]
    chord = np.array([sections.at(at)[1] for at in air_y])
    held = [sections.arm(place) for place, _ in laws.points]
    point_element, point_part = mesh.locate(np.array([at for at, _ in held]))
    points = [np.concatenate([row[:1], arm, row[4:]]) for (_, row), (_, arm) in zip(laws.points, held, strict=True)]
    incidence, genome = condition.angle_of_attack, sections.genome
    root = _root(sections)
    return Beam(
        rest=rest,
        shape=shape,
        slope=slope,
        length=length,
        before=np.einsum("pi,pik->pk", slope, rest[nodes]),
        stiffness=np.array([row[0] for row in rigidity]),
        damping=np.array([row[1] for row in rigidity]),
        steep=laws.steep,
        memory_axis=np.array([row[0] for row in laws.memory], np.int64),
        memory_kind=np.array([row[1] for row in laws.memory], np.int64),
        memory_limit=np.array([row[3] for row in laws.memory]),
        memory_stiffness=_remembering(sections, y, laws),
        element=element,
        part=part,
        mass=np.array([m.mass for m in masses]),
        moment=np.array([m.moment for m in masses]),
        inertia=np.array([m.inertia for m in masses]),
        area=chord * width,
        chord=chord,
        lift=_attack(genome, "L") * chord,
        drag=_attack(genome, "ID") * chord,
        coefficients=np.array([genome[name] for name in ("L_a", "L_b", "ID_a", "ID_b")]),
        air=condition.pressure / (_GAS * condition.temperature),
        wind=condition.airspeed * np.array([np.cos(incidence), 0.0, np.sin(incidence)]),
        gravity=float(condition.gravity),
        air_laws=laws.air_laws,
        remembers=int(bool(np.any(laws.air_laws[[LAG, STALL]] > 0))),
        points=np.array(points).reshape(-1, POINTS),
        point_element=point_element,
        point_part=point_part,
        grip=root[0] - rest[0],
        reach=root[0] - laws.hinge,
        root_stiffness=root[1],
        root_damping=root[2],
        hinge=laws.hinge,
        axle=laws.axle,
        period=1.0 / condition.flap_frequency,
    )


def _remembering(sections: Sections, ys: Array, laws: Laws) -> Array:
    """[P, M]: stiffness (N m^2) of the springs with an internal state at the span positions ``ys`` [P] (m)."""
    plain, found = Sections(sections.wing, sections.genome), np.zeros((len(ys), len(laws.memory)))
    for p, y in enumerate(ys):
        whole = plain.rigidity(y)[0]
        rods = whole - plain.rigidity(y, [])[0]
        for k, (axis, kind, fraction, _) in enumerate(laws.memory):
            found[p, k] = fraction * (rods if kind == SLIDER else whole)[axis]
    return found


def _scaled(mass: Mass, length: float) -> Mass:
    return Mass(mass.mass * length, mass.moment * length, mass.inertia * length)


def _attack(genome: Mapping[str, float], prefix: str) -> float:
    """Point of attack, in chords behind mid-chord, of a force whose quarters of the chord have the genes as weights."""
    weights = np.array([genome[f"{prefix}_{k}"] for k in range(1, 5)])
    return float(weights @ ((np.arange(4) + 0.5) / 4) / weights.sum() - 0.5)


def _root(sections: Sections) -> tuple[Array, Array, Array]:
    """Where the driving rods hold the root [2, 3] (m), and stiffness [2, 6] and damping [2, 6] of their springs.

    The springs are those of a length of wing that is small against the span; either has half of the foam, and its rod.
    With that length tending to zero the root takes the attitude between those of the rods that needs the least energy.
    """
    wing, y = sections.wing, sections.root
    length = _HELD * (sections.tip - y)
    places, rigidities = [], []
    for name in wing.driven_rods:
        rod = next(rod for rod in wing.rods if rod.name == name)
        if not rod.y_root - 0.02 <= y <= rod.y_tip:
            raise ValueError(f"driven rod {name!r} begins at {rod.y_root:g} m, the root is at {y:g} m: bring it there")
        places.append([x_of(rod, max(y, rod.y_root)), y, 0.0])
        rigidities.append(sections.rigidity(y, [rod], 0.5))
    stiffness, damping = (np.array([row[k] for row in rigidities]) / length for k in (0, 1))
    return np.array(places), stiffness, damping


def rod_table(series: npt.NDArray[np.complex128], frequency: float, steps: int) -> Array:
    """[steps + 1, STAGES, 2 rods, 2]: angle (rad) and rate (rad/s) of both rods at all stages of a beat.

    ``series`` [K, 2]: Fourier series of the angles, rad; ``frequency`` of the beat, Hz.
    """
    psi = 2 * np.pi * (np.arange(steps + 1)[:, None] + C) / steps
    k = np.arange(len(series))
    turn = np.exp(1j * psi[..., None] * k)
    angle, slope = (turn @ series).real, (turn @ (1j * k[:, None] * series)).real
    return np.ascontiguousarray(np.stack([angle, 2 * np.pi * frequency * slope], axis=-1))
