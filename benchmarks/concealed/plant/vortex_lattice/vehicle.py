"""A vehicle for the vortex lattice: a pair of wings in forward flight, at angles of attack with attached flow."""

from __future__ import annotations

import math

from wingfit.records import ChordStation, Condition, FourierFlap, FourierPitch, Vehicle, WingMotion

FLIGHTS = (
    (5.0, 5.0, 3.3),
    (5.5, 3.0, 4.6),
    (6.0, 6.0, 4.2),
    (6.5, 1.0, 5.2),
    (7.0, 4.0, 4.6),
    (7.5, 2.0, 6.2),
    (8.0, 5.0, 5.9),
    (9.0, 3.0, 6.6),
)
"""Airspeed (m/s), body pitch (deg) and flap frequency (Hz) of each flight."""


def ornithopter() -> Vehicle:
    """Return a vehicle of 80 g with a pair of wings of 0.35 m that flap by 26 degrees and twist to follow the air."""
    stations = (ChordStation(0.0, 0.115), ChordStation(0.17, 0.105), ChordStation(0.35, 0.060))
    flap = FourierFlap(0.0, (-0.45, 0.02), (0.0, 0.02))
    pitch = FourierPitch(math.pi / 2 + 0.015, (0.04, 0.01), (-0.34, 0.02))
    return Vehicle(
        name="ornithopter", layout="pair", claps=False, stations=stations, wing_mass=3e-3, thickness=2e-4,
        pitch_axis=0.25, dihedral=0.08, mass=0.08, motion=WingMotion(flap, pitch, root_pitch=math.pi / 2),
    )  # fmt: skip


def flights() -> tuple[Condition, ...]:
    """Conditions of the eight FLIGHTS in air at sea level."""
    return tuple(
        Condition(frequency, 0.0, 101325.0, 293.15, airspeed=speed, angle_of_attack=math.radians(pitch))
        for speed, pitch, frequency in FLIGHTS
    )
