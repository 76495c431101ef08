"""A wake that remembers how the wing moved: closed form in a stream, and the force after a reversal in still air."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from sim.kernels import LANES
from sim.kernels.arrays import CHORD_X, CIRCULATION, DRAG, NORMAL_X, STREAM_C, STREAM_N
from tests.sim.effects.moved import History, Motion, Moved
from tests.sim.marching import CHORD

Array = npt.NDArray[np.float64]

OMEGA, N = 6 * np.pi, 240  # of three beats a second, as the harness has it
PLAIN = {"L_a": 3.0, "L_b": 0.0, "ID_a": 1.0, "ID_b": 0.1}
LATEST = 1 / (3.0 * 64)  # s, in which the wing's velocity is known


def pull(history: History) -> Array:
    """Force along z [n, W] on the inner strip, over density and half its area, m^2/s^2."""
    flow, loads = history.flow[:, 0], history.loads[:, 0]
    lift = loads[:, CIRCULATION] * (
        flow[:, STREAM_C] * flow[:, NORMAL_X + 2] - flow[:, STREAM_N] * flow[:, CHORD_X + 2]
    )
    drag = loads[:, DRAG] * (flow[:, STREAM_C] * flow[:, CHORD_X + 2] + flow[:, STREAM_N] * flow[:, NORMAL_X + 2])
    return np.asarray(lift + drag)


def heaving(t: float) -> Motion:
    """Up and down by 0.15 m, three chords: at the top at 0, at the bottom after half a beat."""
    return Motion(heave=0.15 * np.cos(OMEGA * t), heave_rate=-0.15 * OMEGA * np.sin(OMEGA * t))


def test_in_a_stream_the_wake_is_the_wing_delayed() -> None:
    """u = Re(i a e^(i omega t)): the gust is share u (1 / (1 + i omega tau) - 1 / (1 + i omega LATEST))."""
    share, chords = np.linspace(0.1, 0.5, LANES), np.geomspace(0.5, 10.0, LANES)
    moved = Moved("wake_capture", {"share": share, "chords": chords}, airspeed=6.0, genes=PLAIN)

    def slight(t: float) -> Motion:
        return Motion(heave_rate=1e-4 * np.cos(OMEGA * t))

    moved.march(slight, 2 * np.pi / (OMEGA * N), 2 * N)
    found = moved.march(slight, 2 * np.pi / (OMEGA * N), N).induced[:, 0]
    tau = chords * CHORD / 6.0
    gust = 2 / N * np.exp(-2j * np.pi * np.arange(N) / N) @ found[:, 2] / 1e-4
    expected = share * (1 / (1 + 1j * OMEGA * tau) - 1 / (1 + 1j * OMEGA * LATEST))
    np.testing.assert_allclose(gust, expected, rtol=1e-3)
    assert np.abs(found[:, 0]).max() == 0.0
    # nearly opposite to the wing where the wake is old: the wing meets its own wake
    assert gust[-1].real < -0.3 * share[-1]


def test_after_a_reversal_the_wing_runs_into_its_wake() -> None:
    """In still air more force against the new motion at once; the peak of force comes early in the stroke."""
    share = np.repeat([0.0, 0.1, 0.3, 0.5], 2)
    moved = Moved("wake_capture", {"share": share, "chords": 2.0}, genes=PLAIN)
    moved.march(heaving, 2 * np.pi / (OMEGA * N), N)
    history = moved.march(heaving, 2 * np.pi / (OMEGA * N), N)
    force = pull(history)[:, ::2]
    early, late = slice(1, N // 16), slice(7 * N // 16, N // 2)  # of the stroke down
    more = force - force[:, :1]
    assert np.all(force[N // 4] > 0), "air resists the stroke down"
    assert np.all(np.diff(more[early].mean(axis=0)) > 0)
    assert np.all(history.induced[early, 0, 2, 2:] > 0), "air still goes up, as the wing did"
    # a twelfth of a stroke after the reversal it is multiples of what the wing's own speed makes
    assert force[N // 24, -1] > 3 * force[N // 24, 0] > 0
    assert more[early, -1].mean() > 0.0 > more[late, -1].mean()


def test_steady_motion_leaves_no_gust() -> None:
    moved = Moved("wake_capture", {"share": 0.5, "chords": np.geomspace(0.5, 3.0, LANES)}, genes=PLAIN)
    history = moved.march(lambda t: Motion(heave=-t, heave_rate=-1.0), 0.01, 300)
    assert np.abs(history.induced[10]).max() > 0.02
    assert np.abs(history.induced[-1]).max() < 1e-6


def test_the_gust_goes_with_the_distance_from_the_flapping_axis() -> None:
    """And is square to the wing, which has turned."""
    moved = Moved("wake_capture", {"share": 0.3}, airspeed=3.0, strips=4, genes=PLAIN)

    def flapping(t: float) -> Motion:
        return Motion(flap=0.5 + 1e-5 * np.sin(OMEGA * t), flap_rate=1e-5 * OMEGA * np.cos(OMEGA * t))

    induced = moved.march(flapping, 2 * np.pi / (OMEGA * N), N // 2).induced[-1, :, :, 0]
    np.testing.assert_allclose(induced[:, 2] / induced[0, 2], [1, 3, 5, 7], rtol=1e-3)
    np.testing.assert_allclose(induced[:, 1], -induced[:, 2] * np.tan(0.5), rtol=1e-3)


def test_a_side_wind_is_not_taken_for_motion() -> None:
    moved = Moved("wake_capture", {"share": 0.5}, airspeed=4.0, genes=PLAIN)
    moved.here.wind[1] = 3.0
    history = moved.march(lambda _: Motion(pitch=0.2, flap=0.3), 0.002, 50)
    assert np.abs(history.induced).max() < 1e-12


def test_decay_is_the_states_own_derivative() -> None:
    """But for the speed of the flow, which the gust changes little."""
    moved = Moved("wake_capture", {"share": 1e-9, "chords": np.geomspace(0.5, 10.0, LANES)}, airspeed=6.0)
    told, found = moved.decay(Motion(flap_rate=0.5), moved.z + 0.3)
    np.testing.assert_allclose(told, found, rtol=1e-5)
    assert told.min() == pytest.approx(6.0 / (10.0 * CHORD), rel=0.01)
