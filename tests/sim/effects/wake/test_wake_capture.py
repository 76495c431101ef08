"""A wake that remembers how the wing moved: none at a start from rest, closed form in a stream, force at reversal."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from tests.sim.effects.moved import History, Motion, Moved
from tests.sim.kernels.marching import CHORD
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import CHORD_X, CIRCULATION, DRAG, NORMAL_X, STREAM_C, STREAM_N

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


def overtaking(wake: Array, wing: Array) -> Array:
    """What of the velocity of the wake the wing does not take along: w - u min(max(w / u, 0), 1)."""
    along = np.where(wake * wing > 0, np.sign(wing) * np.minimum(np.abs(wake), np.abs(wing)), 0.0)
    return np.asarray(wake - along)


def test_the_part_along_the_wings_way_goes_with_it() -> None:
    """Of a wake and a motion in any two directions: less what lies along the motion, as far as the wing moves."""
    share = np.linspace(0.1, 0.5, LANES)
    moved = Moved("wake_capture", {"share": share}, genes=PLAIN)
    z = np.random.default_rng(3).uniform(-2.0, 2.0, moved.z.shape)
    moved.rate(Motion(), z)
    wake, wing = z.reshape(2, 2, 2, LANES)
    speed = np.linalg.norm(wing, axis=0)
    along = (wake * wing).sum(axis=0) / speed
    assert np.any(along < 0)
    assert np.any((along > 0) & (along < speed))
    assert np.any(along > speed)
    expected = share * (wake - np.clip(along, 0.0, speed) * wing / speed)
    np.testing.assert_allclose(moved.work.induced[:, 1:].swapaxes(0, 1), expected, atol=1e-9)


def test_in_a_stream_the_wake_is_the_wing_delayed() -> None:
    """u = Re(a e^(i omega t)): the wake moves at Re(a e^(i omega t) / (1 + i omega tau)); the wing meets its part."""
    share, chords = np.linspace(0.1, 0.5, LANES), np.geomspace(0.5, 10.0, LANES)
    moved = Moved("wake_capture", {"share": share, "chords": chords}, airspeed=6.0, genes=PLAIN)

    def slight(t: float) -> Motion:
        return Motion(heave_rate=0.01 * np.cos(OMEGA * t))

    moved.march(slight, 2 * np.pi / (OMEGA * N), 2 * N)
    found = moved.march(slight, 2 * np.pi / (OMEGA * N), N).induced[:, 0]
    tau = chords * CHORD / 6.0
    turn = 0.01 * np.exp(2j * np.pi * np.arange(N) / N)[:, None]
    wake, wing = (turn / (1 + 1j * OMEGA * tau)).real, (turn / (1 + 1j * OMEGA * LATEST)).real
    np.testing.assert_allclose(found[:, 2], share * overtaking(wake, wing), atol=1e-5 * share.max())
    assert np.abs(found[:, 0]).max() == 0.0
    # just after the wing has come to rest, as it is known a moment later, the air goes on
    rest = N // 4 + 4
    assert np.all(np.abs(wing[rest]) < 1e-4)
    np.testing.assert_allclose(found[rest, 2, 2:], (share * wake[rest])[2:], rtol=1e-3)
    assert np.all(found[rest, 2, 2:] > 0)


@pytest.mark.parametrize("airspeed", [0.0, 2.0])
def test_a_wing_started_from_rest_finds_no_wake(airspeed: float) -> None:
    """The first stroke from rest is the one without wake capture (Birch and Dickinson 2003)."""
    values: dict[str, npt.ArrayLike] = {"share": 0.5, "chords": np.geomspace(0.5, 10.0, LANES)}
    moved = Moved("wake_capture", values, airspeed=airspeed, genes=PLAIN)
    history = moved.march(lambda t: Motion(pitch=0.2, heave=-2 * t, heave_rate=-2.0), 0.001, 200)
    assert np.abs(history.z[-1].reshape(4, 2, LANES)[1]).min() > 0.1, "though the air about it moves"
    assert np.abs(history.induced).max() < 1e-9


def test_a_wing_that_stops_is_overtaken_by_its_wake() -> None:
    """At once by all of it; and one that slows down by what is faster."""
    moved = Moved("wake_capture", {"share": 0.5, "chords": 2.0}, genes=PLAIN)
    moved.march(lambda _: Motion(heave_rate=-2.0), 0.002, 400)
    slower = moved.march(lambda _: Motion(heave_rate=-1.6), 2e-4, 200).induced[-1, :, 2]
    wake = moved.z.reshape(4, 2, LANES)[1]
    np.testing.assert_allclose(slower, 0.5 * (wake + 1.6), rtol=0.01)
    assert np.all(wake < -1.7)
    stopped = moved.march(lambda _: Motion(heave_rate=1e-3), 2e-4, 200).induced[-1, :, 2]
    np.testing.assert_allclose(stopped, 0.5 * moved.z.reshape(4, 2, LANES)[1], rtol=0.01)


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
    assert np.abs(history.z[-1].reshape(4, 2, LANES)[1] + 1.0).max() < 1e-6, "the air about it goes with it"
    assert np.abs(history.induced).max() < 1e-9


def test_the_gust_goes_with_the_distance_from_the_flapping_axis() -> None:
    """And is square to the wing, which has turned."""
    moved = Moved("wake_capture", {"share": 0.3}, airspeed=3.0, strips=4, genes=PLAIN)

    def flapping(t: float) -> Motion:
        return Motion(flap=0.5 + 1e-4 * np.sin(OMEGA * t), flap_rate=1e-4 * OMEGA * np.cos(OMEGA * t))

    induced = moved.march(flapping, 2 * np.pi / (OMEGA * N), N // 3).induced[-1, :, :, 0]
    assert np.abs(induced[:, 2]).min() > 1e-7, "the wing comes back into air that still goes ahead"
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
    described, found = moved.decay(Motion(flap_rate=0.5), moved.z + 0.3)
    np.testing.assert_allclose(described, found, rtol=1e-5)
    assert described.min() == pytest.approx(6.0 / (10.0 * CHORD), rel=0.01)
