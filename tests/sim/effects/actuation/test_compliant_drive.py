"""A drive that slows down under load."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tests.sim.effects.bench import AIR, Array, beat_of, ledger, scene_of
from tests.sim.effects.driving import robird
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import new_work
from wingfit.sim.kernels.motor import motor_rates
from wingfit.sim.solver.simulate import Beat

OMEGA = 2 * np.pi * AIR.flap_frequency
D, T = 0.01, 0.04
NO_MOTION = 3e-6  # s: what the kernel's states may be off for the periodic motion being found to a few micrometres


def respond(harmonic: int, mean: float, wave: float, beats: int = 6, steps: int = 400) -> Array:
    """Lead, error of speed and mean load [steps, 3] over the last beat of a load mean + wave cos(harmonic psi)."""
    scene = scene_of("compliant_drive", robird(), d=D, t=T)
    lanes = scene.frozen()
    work = new_work(robird().wiring, scene.setting(64), lanes)
    front = len(robird().bodies)
    work.V[front, 0] = 2.0

    def rate(t: float, z: Array) -> Array:
        work.z[:] = z
        work.wrench[front, 0] = -0.5 * (mean + wave * np.cos(harmonic * OMEGA * t))  # the wing resists
        motor_rates(lanes.laws.motor, work)
        return np.array(work.z_rate)

    h, z, kept = 2 * np.pi / OMEGA / steps, np.zeros((3, LANES)), np.zeros((beats * steps, 3))
    for k in range(beats * steps):
        kept[k], t = z[:, 0], k * h
        a = rate(t, z)
        b = rate(t + h / 2, z + h / 2 * a)
        c = rate(t + h / 2, z + h / 2 * b)
        z = z + h / 6 * (a + 2 * b + 2 * c + rate(t + h, z + h * c))
    return kept[-steps:]


@pytest.mark.parametrize("harmonic", [1, 2, 4])
def test_speed_under_a_wave_of_load_in_closed_form(harmonic: int) -> None:
    """sigma (1 + s T + w / s) = -d P s / (s + w) with s = i n w; what mean load there is is not felt."""
    states = respond(harmonic, 5.0, 3.0)
    s = 1j * harmonic * OMEGA
    sigma = -D * 3.0 * s / (s + OMEGA) / (1 + s * T + OMEGA / s)
    found = 2 * np.fft.rfft(states, axis=0)[harmonic] / len(states)
    assert found[1] == pytest.approx(sigma, rel=1e-5)
    assert found[0] == pytest.approx(sigma / s, rel=1e-5)
    np.testing.assert_allclose(states.mean(axis=0), [0.0, 0.0, 5.0], atol=1e-5)


@pytest.mark.parametrize(("harmonic", "part", "early"), [(1, 0.86, 96.0), (2, 1.14, 38.0), (4, 1.05, 16.0)])
def test_what_governor_and_mean_make_of_the_speed_is_as_the_page_says(harmonic: int, part: float, early: float) -> None:
    """Beside a motor of the same droop without them, -d P / (1 + s T)."""
    plain = -D * 3.0 / (1 + 1j * harmonic * OMEGA * T)
    found = 2 * np.fft.rfft(respond(harmonic, 0.0, 3.0)[:, 1])[harmonic] / 400 / plain
    assert abs(found) == pytest.approx(part, abs=0.005)
    assert np.degrees(np.angle(found)) == pytest.approx(early, abs=0.6)


def test_a_fast_motor_under_fast_load_falls_back_by_d_times_the_load() -> None:
    """Where the governor and the average are too slow to see it."""
    states = respond(40, 0.0, 3.0)
    s = 1j * 40 * OMEGA
    found = 2 * np.fft.rfft(states, axis=0)[40] / len(states)
    assert found[1] == pytest.approx(-D * 3.0 / (1 + s * T), rel=0.05)


@cache
def beat(d: float = 0.01, t: float = 0.02, steps: int = 192) -> Beat:
    return beat_of("compliant_drive", AIR, steps, d=d, t=t)


def states_of(one: Beat) -> Array:
    assert one.motion is not None
    return np.asarray(one.motion.z)


def test_rods_are_late_after_heavy_load() -> None:
    """Speed is below its mean where the motors give most, the lead least a little later; the mean lead is zero."""
    found = beat()
    lead, speed, _ = states_of(found).T
    load = found.power[:, 1:3].sum(axis=1)
    assert np.corrcoef(speed, load)[0, 1] < -0.5
    heavy, latest = int(load.argmax()), int(lead.argmin())
    assert 0 < (latest - heavy) % len(load) < len(load) // 3
    assert lead.min() < -1e-3
    assert abs(lead.mean()) < NO_MOTION


def test_rods_follow_the_profile_at_the_time_of_their_lead() -> None:
    found = beat()
    assert found.motion is not None
    steps, bodies = len(found.tracks), len(robird().bodies)
    lead, speed, _ = states_of(found).T
    psi = 2 * np.pi * np.arange(steps) / steps + OMEGA * lead
    described = scene_of("compliant_drive", robird()).rods.angles(psi)[:, :, :2, 0]
    R, V = found.motion.R[:, bodies:], found.motion.V[:, bodies:]
    np.testing.assert_allclose(np.arctan2(R[..., 7], R[..., 4]), described[..., 0], atol=1e-6)
    np.testing.assert_allclose(V[..., 0], described[..., 1] * OMEGA * (1 + speed)[:, None], atol=2e-4)


@pytest.mark.parametrize(("d", "t"), [(0.005, 0.04), (0.02, 0.2), (0.02, 0.02)])
def test_the_work_of_the_motors_closes_the_ledger(d: float, t: float) -> None:
    assert ledger(beat(d, t), AIR.flap_frequency) < 5e-4


def test_the_motion_changes_in_proportion_to_a_small_droop() -> None:
    nominal = beat(0.0).tracks
    half, whole = (beat(d, 0.04).tracks - nominal for d in (0.001, 0.002))
    np.testing.assert_allclose(whole, 2 * half, atol=0.1 * np.abs(whole).max())
    assert np.abs(whole).max() > 3e-4
