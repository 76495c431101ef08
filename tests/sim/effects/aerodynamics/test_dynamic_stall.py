"""The static curve, the sense and width of the loop, and its delay."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from tests.sim.effects.moved import History, Motion, Moved
from tests.sim.effects.rigs import CONDITIONS, wing_model
from tests.sim.kernels.marching import CHORD
from wingfit.sim.kernels.arrays import ALPHA, CIRCULATION, LIFT_SLOPE, SPEED
from wingfit.sim.virtual_rigs.campaign import blank_recording
from wingfit.sim.wing.flexible_wing import FlexibleWing

Array = npt.NDArray[np.float64]

PLAIN = {"L_a": 5.0, "L_b": 0.0}
AIRSPEED = 6.0
ANGLE, WIDTH = 0.3, 0.06


def lift(history: History) -> tuple[Array, Array]:
    """Angle of attack and lift coefficient [n, W] of the inner strip."""
    return history.flow[:, 0, ALPHA], history.loads[:, 0, CIRCULATION] / history.flow[:, 0, SPEED]


def kirchhoff(alpha: Array) -> Array:
    """Of the static lift of an attached wing, by the law as printed."""
    attached = 1 / (1 + np.exp((alpha - ANGLE) / WIDTH))
    return np.asarray((0.5 + 0.5 * np.sqrt(attached)) ** 2)


def pitching(k: npt.ArrayLike, beats: int = 2, n: int = 300, **values: npt.ArrayLike) -> tuple[Array, Array]:
    """Alpha and lift coefficient [n, W] of the last beat of a wing that pitches at reduced frequencies ``k`` [W]."""
    omega = 20.0
    own: dict[str, npt.ArrayLike] = {"share": 1.0, "angle": ANGLE, "width": WIDTH, "delay": 1.0, "advance": 3.0}
    moved = Moved("dynamic_stall", own | values, airspeed=0.5 * omega * CHORD / np.asarray(k), genes=PLAIN)
    history = moved.march(lambda t: Motion(pitch=ANGLE - 0.2 * np.cos(omega * t)), 2 * np.pi / (omega * n), beats * n)
    alpha, cl = lift(history)
    return alpha[-n:], cl[-n:]


def area(alpha: Array, cl: Array) -> Array:
    """Of the loop [W], positive where lift is larger on the way up."""
    return np.asarray((cl * (np.roll(alpha, -1, 0) - np.roll(alpha, 1, 0)) / 2).sum(axis=0))


def test_at_rest_the_lift_is_kirchhoffs() -> None:
    alpha = np.linspace(-0.5, 0.7, 8)
    moved = Moved("dynamic_stall", {"share": 1.0, "angle": ANGLE, "width": WIDTH}, airspeed=AIRSPEED, genes=PLAIN)
    history = moved.march(lambda _: Motion(pitch=alpha), 0.1 * CHORD / AIRSPEED, 100)
    _, cl = lift(history)
    np.testing.assert_allclose(cl[-1], 5.0 * alpha * kirchhoff(np.abs(alpha)), rtol=1e-5)
    half = Moved("dynamic_stall", {"share": 0.5, "angle": ANGLE, "width": WIDTH}, airspeed=AIRSPEED, genes=PLAIN)
    _, less = lift(half.march(lambda _: Motion(pitch=alpha), 0.1 * CHORD / AIRSPEED, 100))
    np.testing.assert_allclose(less[-1], 0.5 * (5.0 * alpha + cl[-1]), rtol=1e-6)


def test_the_slope_is_stalled_like_the_lift() -> None:
    """At a held separation the lift is this part of the attached one, and so is its change with alpha."""
    alpha = np.linspace(0.1, 0.7, 8)
    values = {"share": 0.7, "angle": ANGLE, "width": WIDTH}
    moved = Moved("dynamic_stall", values, airspeed=AIRSPEED, genes=PLAIN)
    history = moved.march(lambda _: Motion(pitch=alpha), 0.1 * CHORD / AIRSPEED, 100)
    left = 1 - 0.7 * (1 - kirchhoff(alpha))
    assert left.min() < 0.5
    np.testing.assert_allclose(history.loads[-1, 0, LIFT_SLOPE], 5.0 * AIRSPEED * left, rtol=1e-5)


def test_circulation_of_rotation_does_not_stall() -> None:
    """Kirchhoff's law is one of the angle of attack: a wing without such lift moves as without stall."""
    model = wing_model().with_effects("dynamic_stall", "rotational_circulation")
    assert isinstance(model, FlexibleWing)
    recording = blank_recording(model.wing, CONDITIONS["air"])
    described = {gene.name: gene.nominal for gene in model.genes} | {"L_a": 0.0, "L_b": 0.0}
    described["dynamic_stall.angle"] = 0.15
    tracks = []
    for share, coefficient in ((0.0, 0.0), (0.0, 6.0), (1.0, 6.0)):
        described |= {"dynamic_stall.share": share, "rotational_circulation.coefficient": coefficient}
        tracks.append(model.beat([described[gene.name] for gene in model.genes], recording).tracks)
    plain, rotating, stalled = tracks
    assert np.abs(rotating - plain).max() > 5e-4
    assert np.abs(stalled - rotating).max() < 2e-5, "except for the remaining distance to the periodic motion"


def test_stall_is_late_on_the_way_up_and_more_so_at_higher_frequency() -> None:
    """The loop is run clockwise; it widens with the frequency while the delays are short beside a beat."""
    k = np.array([0.02, 0.03, 0.04, 0.05, 0.06, 0.08, 0.1, 0.12])
    alpha, cl = pitching(k)
    width = area(alpha, cl)
    assert np.all(width > 0)
    assert np.all(np.diff(width) > 0)
    quasi = 5.0 * alpha * kirchhoff(alpha)
    up = np.diff(alpha[:, -1], append=alpha[0, -1]) > 0
    assert cl[:, -1].max() > 1.15 * quasi[:, -1].max(), "overshoots the static lift"
    assert np.mean((cl - quasi)[up, -1]) > 0 > np.mean((cl - quasi)[~up, -1])


def test_slowly_both_delays_add() -> None:
    """To first order X = X_0(alpha - (tau_1 + tau_2) alpha'): the width of the loop goes with the sum."""
    delay, advance = np.array([[3.0, 0.0], [1.0, 2.0], [0.5, 2.5], [0.75, 0.75]] * 2).T
    width = area(*pitching(0.01, n=600, delay=delay, advance=advance))[:4]
    np.testing.assert_allclose(width[:3], width[0], rtol=0.03)
    assert width[3] == pytest.approx(0.5 * width[0], rel=0.05)


def test_the_flow_relaxes_with_the_chords_travelled() -> None:
    """After alpha has stayed long enough for its rate to be nought: exp(-chords / delay)."""
    delay = np.linspace(2.0, 9.0, 8)
    own: dict[str, npt.ArrayLike] = {"share": 1.0, "angle": ANGLE, "width": 0.02, "delay": delay, "advance": 0.0}
    moved = Moved("dynamic_stall", own, airspeed=AIRSPEED, genes=PLAIN)
    z = moved.march(lambda _: Motion(pitch=0.6), 0.05 * CHORD / AIRSPEED, 101).z[:, 0]
    np.testing.assert_allclose(1 - z[100], np.exp(-5.0 / delay), rtol=1e-4)


def test_decay_is_the_states_own_derivative() -> None:
    moved = Moved("dynamic_stall", {"delay": np.geomspace(0.2, 10.0, 8), "advance": 0.0}, airspeed=AIRSPEED)
    described, found = moved.decay(Motion(pitch=0.3), moved.z + 0.3)
    np.testing.assert_allclose(described, found, rtol=1e-6)


def test_nothing_happens_without_flow() -> None:
    moved = Moved("dynamic_stall", {"share": 1.0})
    assert np.abs(moved.rate(Motion(pitch=0.3), moved.z + 0.1)).max() < 1e-6
