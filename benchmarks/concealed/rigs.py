"""The rigs of the blind trials, their grids of conditions, and what a laboratory knows of them.

Besides the Robird's wing and the DelFly there are wings of other size and layout, one with the proportions of a bird's
and one of an insect's, and a vehicle with a single pair of wings. Positions of markers are measured by hand, and
densities by weighing a sample, so a description is never exact.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.concealed.plant.vortex_lattice.vehicle import FLIGHTS, ornithopter
from wingfit.records import (
    ChordStation,
    FourierDrive,
    FourierFlap,
    FourierPitch,
    Hinge,
    Marker,
    Materials,
    Rod,
    Station,
    Vehicle,
    Wing,
    WingMotion,
)
from wingfit.sim.virtual_rigs.balance import delfly
from wingfit.sim.virtual_rigs.campaign import robird_wing

BY_HAND = (2e-4, 8e-4)  # of the Robird's wing: least and largest standard deviation of rest positions, m
BY_SAMPLE = 0.03  # standard deviation of the relative error of a density


@dataclass(frozen=True)
class Grid:
    """Conditions of a rig's campaigns.

    ``frequencies``: five (Hz), ascending. ``speeds``: five (m/s), ascending; empty for a vehicle. ``flights`` of a
    vehicle: airspeed (m/s), body pitch (deg) and flap frequency (Hz).
    """

    frequencies: tuple[float, ...] = ()
    speeds: tuple[float, ...] = ()
    flights: tuple[tuple[float, float, float], ...] = ()


def bird_wing() -> Wing:
    """Return a wing of 0.8 m with the planform of a gull's: a broad arm, a slender hand that sweeps aft; 40 markers."""
    stations = (
        (0.04, 0.00, 0.22, 0.016),
        (0.20, -0.03, 0.24, 0.015),
        (0.38, -0.04, 0.21, 0.013),
        (0.56, 0.01, 0.16, 0.011),
        (0.72, 0.08, 0.11, 0.010),
        (0.84, 0.15, 0.06, 0.009),
    )
    rods = (
        Rod("spar", 0.030, 0.04, 0.100, 0.74, 0.006, 1600.0, 0.012),
        Rod("arm", 0.130, 0.04, 0.140, 0.50, 0.004, 1600.0, 0.010),
    )
    drive = FourierDrive(0.12, (-0.50, 0.03), (0.0, 0.02))
    return _wing("bird", stations, rods, Materials(28.0, 0.30), (8, 5), 2, Hinge(0.0, 0.01), drive)


def insect_wing() -> Wing:
    """Return a wing of 0.16 m with the proportions of a hawkmoth's, broad near the root and rounded; 25 markers."""
    stations = (
        (0.012, 0.000, 0.050, 0.0040),
        (0.040, -0.006, 0.074, 0.0036),
        (0.080, -0.006, 0.078, 0.0032),
        (0.120, 0.002, 0.064, 0.0028),
        (0.150, 0.012, 0.044, 0.0024),
        (0.170, 0.022, 0.024, 0.0020),
    )
    rods = (
        Rod("costa", 0.006, 0.012, 0.014, 0.150, 0.0014, 1600.0, 0.0012),
        Rod("cubitus", 0.034, 0.012, 0.046, 0.120, 0.0010, 1600.0, 0.0010),
    )
    drive = FourierDrive(0.0, (-0.70, 0.0), (0.0, 0.04))
    return _wing("insect", stations, rods, Materials(30.0, 0.08), (5, 5), 1, Hinge(0.0, 0.0), drive)


def _wing(
    name: str,
    stations: tuple[tuple[float, float, float, float], ...],
    rods: tuple[Rod, Rod],
    materials: Materials,
    grid: tuple[int, int],
    reference: int,
    hinge: Hinge,
    drive: FourierDrive,
) -> Wing:
    """Return a wing with a ``grid`` of markers along span and chord; the mean of a column starts the beat.

    ``reference``: number of that column, from the leading edge.
    """
    y, edge, chord, thickness = (np.array(column) for column in zip(*stations, strict=True))
    along, across = grid
    markers = list[Marker]()
    for b in y[0] + (y[-1] - y[0]) * (np.arange(along) + 0.6) / (along + 0.1):
        for s in 0.05 + 0.9 * np.arange(across) / (across - 1):
            x = float(np.interp(b, y, edge) + s * np.interp(b, y, chord))
            place = (round(x, 5), round(float(b), 5), round(float(np.interp(b, y, thickness)) / 2, 5))
            markers.append(Marker(f"p{len(markers) + 1:02d}", place, 5e-5 * (y[-1] / 0.52) ** 3))
    starts = tuple(markers[k * across + reference].name for k in range(along))
    return Wing(
        name, tuple(Station(*row) for row in stations), materials, rods, (rods[0].name, rods[1].name), tuple(markers),
        starts, hinge, drive,
    )  # fmt: skip


def pair_vehicle() -> Vehicle:
    """Return a vehicle of 45 g with a single pair of wings, of 0.2 m each, that do not touch."""
    stations = (ChordStation(0.0, 0.070), ChordStation(0.09, 0.078), ChordStation(0.20, 0.036))
    flap = FourierFlap(0.10, (-0.95, 0.02), (0.0, 0.03))
    pitch = FourierPitch(math.pi / 2, (0.05, 0.0), (-0.62, 0.04))
    return Vehicle(
        name="pair", layout="pair", claps=False, stations=stations, wing_mass=0.9e-3, thickness=2e-5, pitch_axis=0.1,
        dihedral=0.05, mass=45e-3, motion=WingMotion(flap, pitch, root_pitch=math.pi / 2),
    )  # fmt: skip


ROBIRD = Grid((2.0, 2.5, 3.0, 3.5, 4.0), (3.5, 5.0, 6.0, 7.5, 8.5))
BIRD = Grid((1.2, 1.5, 1.8, 2.1, 2.4), (4.0, 5.5, 7.0, 8.5, 10.0))
INSECT = Grid((7.0, 8.5, 10.0, 11.5, 13.0), (1.5, 2.0, 2.5, 3.0, 3.5))
# Body pitch and flap frequency of the DelFly by airspeed (Armanini et al. 2016, Table 4).
DELFLY = Grid(
    flights=(
        (0.30, 83, 13.3),
        (0.50, 74, 12.5),
        (0.55, 70, 12.5),
        (0.65, 71, 12.5),
        (0.70, 62, 11.7),
        (0.80, 65, 13.3),
        (1.00, 45, 11.7),
        (2.00, 31, 10.3),
    )
)
PAIR = Grid(
    flights=(
        (0.40, 75, 9.6),
        (0.60, 70, 9.4),
        (0.80, 66, 9.2),
        (1.20, 58, 9.0),
        (1.60, 50, 8.6),
        (2.00, 42, 8.8),
        (2.60, 34, 8.2),
        (3.20, 27, 8.0),
    )
)

WINGS: Mapping[str, tuple[Wing, Grid]] = {
    "robird": (robird_wing(), ROBIRD),
    "bird": (bird_wing(), BIRD),
    "insect": (insect_wing(), INSECT),
}
VEHICLES: Mapping[str, tuple[Vehicle, Grid]] = {
    "delfly": (delfly(), DELFLY),
    "pair": (pair_vehicle(), PAIR),
    "ornithopter": (ornithopter(), Grid(flights=FLIGHTS)),
}
GRIDS = {name: grid for name, (_, grid) in (*WINGS.items(), *VEHICLES.items())}


def size_of(wing: Wing) -> float:
    """Size of a wing relative to the Robird's: of its span, and so of its cameras' distance and noise."""
    return wing.span / WINGS["robird"][0].span


def as_described(wing: Wing, rng: np.random.Generator, deviation: float | None = None) -> Wing:
    """Return the description of ``wing`` that a laboratory makes: positions by hand, densities by weighing a sample.

    ``deviation``: standard deviation of rest positions along each axis (m), drawn if None.
    """
    deviation = size_of(wing) * float(rng.uniform(*BY_HAND)) if deviation is None else deviation
    moves = deviation * rng.standard_normal((len(wing.markers), 3))
    markers = tuple(
        replace(one, position=tuple(np.round(np.array(one.position) + move, 5).tolist()))
        for one, move in zip(wing.markers, moves, strict=True)
    )
    foam, skin = 1.0 + BY_SAMPLE * rng.standard_normal(2)
    materials = Materials(wing.materials.foam_density * foam, wing.materials.skin_areal_density * skin)
    return replace(wing, markers=markers, materials=materials)
