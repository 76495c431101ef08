"""Flat plates that flap in a stream, by Theodorsen and Garrick in closed form: what quasi-steady models leave out."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

import wingfit
from tests.oracles.unsteady_airfoil import theodorsen
from tests.sim.vehicle.vehicles import recording
from wingfit.records import ChordStation, Dataset, FourierFlap, FourierPitch, Recording, Vehicle, WingMotion
from wingfit.records.array_types import Array

SPAN, CHORD, STROKE = 0.35, 0.10, 0.15  # m, m, rad
DENSITY = 101325.0 / 287.05 / 293.15
FLIGHTS = ((5.5, 3.0, 4.6), (6.5, 1.0, 5.2), (7.5, 2.0, 6.2), (9.0, 3.0, 6.6))  # m/s, deg, Hz


def plates() -> Vehicle:
    """Two plates that flap by a cosine, with their chords along the body."""
    flap, pitch = FourierFlap(0.0, (-STROKE,), (0.0,)), FourierPitch(math.pi / 2, (0.0,), (0.0,))
    return Vehicle(
        name="plates", layout="pair", claps=False, stations=(ChordStation(0.0, CHORD), ChordStation(SPAN, CHORD)),
        wing_mass=1e-6, thickness=2e-4, pitch_axis=0.5, dihedral=0.0, mass=0.08,
        motion=WingMotion(flap, pitch, root_pitch=math.pi / 2),
    )  # fmt: skip


def forces(speed: float, incidence: float, frequency: float, times: Array, sense: float) -> Array:
    """Force [T, 2] (N, body x and z) of both wings for a small stroke; ``sense`` -1: they flap the other way round.

    Per span, with the half chord b and the plate's downward velocity h': N = 2 pi rho V b (V sin(alpha) + C h') +
    pi rho b^2 h'' across the plate (Theodorsen 1935, NACA Report 496, Eq. XX), and the suction 2 pi rho b
    (V sin(alpha) + C h')^2 along it (Garrick 1936, NACA Report 567).
    """
    rate, half = 2.0 * math.pi * frequency, CHORD / 2.0
    deficiency = theodorsen(np.array([rate * half / speed]))[0]
    turn = np.exp(1j * (rate * times - 0.5 * math.pi))
    found = np.zeros((len(times), 2))
    stations = (np.arange(60) + 0.5) / 60.0 * SPAN
    for r in stations:
        heave = sense * r * STROKE * rate * turn
        upwash = speed * math.sin(incidence) + (deficiency * heave).real
        normal = 2.0 * math.pi * DENSITY * speed * half * upwash
        normal += math.pi * DENSITY * half**2 * (1j * rate * heave).real
        found += 2.0 * SPAN / 60.0 * np.stack([2.0 * math.pi * DENSITY * half * upwash**2, -normal], axis=1)
    return found


def recorded(sense: float) -> Dataset:
    """Four flights of twelve beats with white noise of 10 mN, a hundredth of the force."""
    rng, flights = np.random.default_rng(3), list[Recording]()
    for speed, pitch_deg, frequency in FLIGHTS:
        plain = recording(frequency, speed, math.radians(pitch_deg))
        times = np.arange(0.0, 12.0 / frequency, 1.0 / (200.0 * frequency))
        clean = forces(speed, plain.condition.angle_of_attack, frequency, times, sense)
        noisy = clean + 0.01 * rng.standard_normal(clean.shape)
        flights.append(replace(plain, name=f"flight-{len(flights)}", times=times, values=noisy))
    return Dataset("plates", plates(), tuple(flights))


def test_the_lag_of_the_circulation_is_named() -> None:
    found = wingfit.diagnose(recorded(1.0))
    assert (found.verdict, found.named) == ("named", ("circulation_lag",))
    genes = {gene.name: gene.value for gene in found.hypotheses[0].genes}
    assert 0.85 < genes["circulation_lag.share"].value < 1.1


def test_wings_that_flap_the_other_way_round_start_half_a_beat_later() -> None:
    """No balance is blamed for what the lag of the circulation leaves: a choice is tried as a whole, not in part."""
    found = wingfit.diagnose(recorded(-1.0))
    assert found.named[:1] == ("phase_reference",)
    assert set(found.named) <= {"phase_reference", "circulation_lag"}
    assert "The checks of the dataset find it, too (force phase): correct the dataset" in found.summary
    assert any(one.startswith("likely mistake in the dataset: all recordings, force phase: ") for one in found.remarks)
