"""Input of the other engines (scipy, Exudyn): masses, connectors, air coefficients and drive of one wing, as arrays.

It contains data only; each engine evaluates all forces by its own code.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wingfit.records import Condition, Gene
from wingfit.sim.atmosphere import density
from wingfit.sim.kernels.arrays import AREA
from wingfit.sim.kernels.jit import allocating
from wingfit.sim.wing.drive import flap_angle
from wingfit.sim.wing.genes import lanes
from wingfit.sim.wing.structure import Structure

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

_SAMPLES, _HARMONICS = 512, 40


class PeerWing(NamedTuple):
    """A wing with given genes under one condition, in SI units.

    N bodies are grouped in S strips along the span; N and N + 1 are the front and the rear driving rod. "Thesis" is van
    der Grinten's.

    Attributes:
        mass: [N] kg.
        inertia: [N, 3, 3] kg m^2 about the centre of mass, body axes.
        rest: [N, 3] centres of mass at rest, m; all bodies are aligned with the world there.
        first, second: [C] the two bodies that each of C connectors joins.
        a, b: [C, 3] position of the connector on the first and second body, from its centre of mass (rod: the hinge),
            m.
        stiffness, damping: [C, 6] about x, y, z (N m/rad), then along x, y, z (N/m), of the first body's axes; damping:
            these units times s.
        strip: [S + 1] first body of each strip, then N.
        weight: [N] share of the body in its strip's area.
        centroid: [N, 2] x and y of the body's planform centroid, from its centre of mass, m.
        area: [S] area of each strip, m^2.
        coefficients: [4] L_a, L_b, ID_a, ID_b (thesis Eqs. 10-11).
        lift, drag: [N, 2] share of the strip's force (thesis Eqs. 12-13), and x where it acts, from the centre of mass,
            m.
        air: density, kg/m^3; ``wind`` [3]: velocity, m/s; ``gravity``: m/s^2.
        hinge: [3] a point on the axis about which the rods rotate, which is parallel to x, m.
        mean: mean flap angle, rad.
        harmonics: [H, 2] cosine and sine amplitudes of the flap angle about the mean, rad.
        omega: angular frequency of flapping, rad/s.
        lag: [2] phase lag of the front and the rear rod, rad.
        ramp: duration of the start, in which the amplitude grows from zero, s.
        markers: [M, 3] position of each marker, in the frame of the body ``carrier`` [M], m.
    """

    mass: Array
    inertia: Array
    rest: Array
    first: Index
    second: Index
    a: Array
    b: Array
    stiffness: Array
    damping: Array
    strip: Index
    weight: Array
    centroid: Array
    area: Array
    coefficients: Array
    lift: Array
    drag: Array
    air: float
    wind: Array
    gravity: float
    hinge: Array
    mean: float
    harmonics: Array
    omega: float
    lag: Array
    ramp: float
    markers: Array
    carrier: Index


def peer_wing(
    structure: Structure, genes: tuple[Gene, ...], genome: Array, condition: Condition, ramp_beats: int = 1
) -> PeerWing:
    """Return the arrays of the wing with the gene values ``genome`` [G] under ``condition``.

    ``ramp_beats``: duration of the start-up ramp, beats.
    """
    group, w = lanes(structure, genes, genome[None]), structure.wiring
    incidence, hinge = condition.angle_of_attack, structure.wing.hinge
    mean, harmonics = _drive_series(structure)
    return PeerWing(
        mass=w.mass,
        inertia=w.inertia.reshape(-1, 3, 3).copy(),
        rest=np.array([body.centre for body in structure.bodies]),
        first=w.first,
        second=w.second,
        a=w.a,
        b=w.b,
        stiffness=group.stiffness[..., 0].copy(),
        damping=group.damping[..., 0].copy(),
        strip=w.strip_start,
        weight=w.weight,
        centroid=w.centroid.copy(),
        area=w.geometry[:, AREA].copy(),
        coefficients=group.coefficients[:, 0].copy(),
        lift=np.stack([group.lift_share[:, 0], group.lift_x[:, 0]], axis=-1),
        drag=np.stack([group.drag_share[:, 0], group.drag_x[:, 0]], axis=-1),
        air=float(density(condition.pressure, condition.temperature)),
        wind=condition.airspeed * np.array([np.cos(incidence), 0.0, np.sin(incidence)]),
        gravity=float(condition.gravity),
        hinge=np.array([0.0, hinge.y, hinge.z]),
        mean=mean,
        harmonics=harmonics,
        omega=float(2 * np.pi * condition.flap_frequency),
        lag=np.array([0.0, condition.phase_lag]),
        ramp=float(ramp_beats / condition.flap_frequency),
        markers=w.markers,
        carrier=w.carrier,
    )


def _drive_series(structure: Structure) -> tuple[float, Array]:
    """Return the mean (rad) and the cosine and sine amplitudes [H, 2] (rad) of the driving rods' flap angle."""
    psi = 2 * np.pi * np.arange(_SAMPLES) / _SAMPLES
    spectrum = np.fft.rfft(flap_angle(structure.wing.drive, psi)[:, 0]) / _SAMPLES
    head = 2 * spectrum[1 : _HARMONICS + 1]
    return float(spectrum[0].real), np.stack([head.real, -head.imag], axis=-1)


@allocating
def rod_motion(wing: PeerWing, t: float, rod: int) -> tuple[float, float]:
    """Return the angle (rad) and its rate (rad/s) of a rod at time ``t`` (s).

    ``rod``: 0 is the front, 1 the rear rod. The periodic drive is multiplied by a quintic ramp from 0 to 1.
    """
    psi = wing.omega * t - wing.lag[rod]
    angle, slope = wing.mean, 0.0
    c1, s1 = np.cos(psi), np.sin(psi)
    c, s = c1, s1
    for k in range(len(wing.harmonics)):
        angle += wing.harmonics[k, 0] * c + wing.harmonics[k, 1] * s
        slope += (k + 1) * (wing.harmonics[k, 1] * c - wing.harmonics[k, 0] * s)
        c, s = c * c1 - s * s1, s * c1 + c * s1
    x = min(max(t / wing.ramp, 0.0), 1.0)
    share = x * x * x * (10.0 + x * (6.0 * x - 15.0))
    growth = 30.0 * (x * (1.0 - x)) ** 2 / wing.ramp
    return share * angle, share * wing.omega * slope + growth * angle
