"""Acceleration to the periodic motion: a linear map with a known fixed point, and the wing itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from wingfit.sim.kernels.arrays import State
from wingfit.sim.kernels.chart import LENGTH, coordinates, displaced
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.solver.periodic import Secants
from wingfit.sim.solver.settle import _mean_growth
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing

Array = npt.NDArray[np.float64]

BODIES, RATE = 2, 20.0
NO_STATES = NO_SIZES = np.zeros(0)


class LinearBeat:
    """A map from state to state with given decays per beat along random modes, and its fixed point at ``fixed``."""

    def __init__(self, decays: tuple[float, ...], seed: int) -> None:
        rng = np.random.default_rng(seed)
        moving = np.tile(~np.isin(np.arange(12), (1, 2)), BODIES)  # rotations about x alone add
        self.fixed = 1e-2 * rng.normal(size=12 * BODIES) * moving
        modes = np.linalg.qr(rng.normal(size=(12 * BODIES, len(decays))) * moving[:, None])[0]
        self.slope = modes @ np.diag(decays) @ modes.T
        self.start = self.fixed + 1e-2 * modes.sum(axis=1)

    def __call__(self, state: State) -> State:
        return self.state(self.fixed + self.slope @ (self.coordinates(state) - self.fixed))

    def state(self, x: Array) -> State:
        body = x.reshape(BODIES, 12)
        turn = np.zeros((BODIES + 2, 3))
        turn[:BODIES, 0] = body[:, 0]
        place, twist = np.zeros((BODIES + 2, 3)), np.zeros((BODIES + 2, 6))
        place[:BODIES], twist[:BODIES] = body[:, 3:6], body[:, 6:] * RATE
        return State(Rotation.from_rotvec(turn).as_matrix().reshape(-1, 9), place, twist, NO_STATES)

    def coordinates(self, state: State) -> Array:
        turn = Rotation.from_matrix(state.R[:BODIES].reshape(-1, 3, 3)).as_rotvec()
        return np.concatenate([turn, state.p[:BODIES], state.V[:BODIES] / RATE], axis=1).ravel()


def follow(beat: LinearBeat, count: int, kept: int = 8) -> tuple[State, list[float], Secants]:
    """State after ``count`` accelerated beats from the start, and the estimated distances."""
    state, estimated = beat.state(beat.start), []
    secants = Secants(state, RATE, kept, NO_SIZES)
    for _ in range(count):
        state, distance = secants.add(state, beat(state))
        estimated.append(distance)
    return state, estimated, secants


@pytest.mark.parametrize("decays", [(0.8,), (0.7, -0.5), (0.8, 0.5, -0.3), (0.95, 0.9)])
def test_finds_the_fixed_point_with_one_beat_more_than_modes(decays: tuple[float, ...]) -> None:
    beat = LinearBeat(decays, 1)
    end, _, _ = follow(beat, len(decays) + 1)
    expected = beat.state(beat.fixed)
    np.testing.assert_allclose(end.p, expected.p, atol=1e-8)
    np.testing.assert_allclose(end.V, expected.V, atol=1e-6)
    np.testing.assert_allclose(end.R, expected.R, atol=1e-7)


def test_distance_is_to_the_fixed_point_and_not_to_the_next_beat() -> None:
    """A mode that keeps 0.95 a beat moves by a twentieth of the remaining distance, which is not convergence."""
    beat = LinearBeat((0.95, 0.2), 2)
    state = beat.state(beat.start)
    secants = Secants(state, RATE, 8, NO_SIZES)
    for _ in range(3):
        here = state
        state, estimated = secants.add(state, beat(state))
    left, moved = (
        np.abs(beat.coordinates(s) - beat.coordinates(here)).max() for s in (beat.state(beat.fixed), beat(here))
    )
    assert estimated == pytest.approx(left, rel=0.5)
    assert moved < 0.5 * left


@pytest.mark.parametrize("decay", [0.96, 0.99])
def test_a_mode_too_slow_to_extrapolate_does_not_count_as_periodic(decay: float) -> None:
    """If the extrapolation would be too long, the distance is still that to the fixed point."""
    beat = LinearBeat((decay,), 6)
    state = beat.state(beat.start)
    secants = Secants(state, RATE, 8, NO_SIZES)
    for _ in range(4):
        here = state
        state, estimated = secants.add(state, beat(state))
    assert not secants.extrapolated
    assert estimated == pytest.approx(
        np.abs(beat.coordinates(beat.state(beat.fixed)) - beat.coordinates(here)).max(), rel=0.1
    )


class RingingBeat(LinearBeat):
    """One mode ``pace`` times as fast as the beat, caught at another phase each time: V is large where x is small."""

    def __init__(self, decay: float, turn: float, pace: float) -> None:
        super().__init__((0.0,), 7)
        self.slope = np.zeros((12 * BODIES, 12 * BODIES))
        for body, angle in enumerate((turn, 0.7 * turn)):
            here = [12 * body + 3, 12 * body + 9]  # displacement along x, velocity along x
            c, s = decay * np.cos(angle), decay * np.sin(angle)
            self.slope[np.ix_(here, here)] = [[c, s / pace], [-s * pace, c]]
        self.start = self.fixed.copy()
        self.start[[3, 15]] += 1e-2


@pytest.mark.parametrize("turn", [0.6, 1.0, 2.0])
def test_modes_faster_than_the_beat_are_learnt(turn: float) -> None:
    """Two of them, four unknowns: five beats. A beat that changes more only because it is caught at another phase is no
    failed extrapolation.
    """
    beat = RingingBeat(0.85, turn, 8.0)
    end, estimated, _ = follow(beat, 6)
    assert np.all(np.isfinite(estimated)), "an extrapolation was reverted"
    np.testing.assert_allclose(end.p, beat.state(beat.fixed).p, atol=1e-7)


@pytest.mark.parametrize("decays", [(0.6, 0.3), (1.3, 0.5), (-0.9, 0.2, 0.1), (-1.2, 0.4)])
def test_growth_is_the_largest_multiplier(decays: tuple[float, ...]) -> None:
    _, _, secants = follow(LinearBeat(decays, 6), len(decays) + 1)
    assert secants.growth == pytest.approx(max(abs(d) for d in decays), rel=0.05)


def test_without_secants_there_is_no_acceleration() -> None:
    beat = LinearBeat((0.8,), 3)
    end, estimated, _ = follow(beat, 4, kept=0)
    expected = beat.state(beat.start)
    for _ in range(4):
        expected = beat(expected)
    for found, value in zip(end, expected, strict=True):
        np.testing.assert_array_equal(found, value)
    assert estimated[-1] < estimated[0]


def test_an_extrapolation_that_enlarges_the_change_is_reverted() -> None:
    beat = LinearBeat((0.8, 0.5), 4)
    state = beat.state(beat.start)
    secants = Secants(state, RATE, 8, NO_SIZES)
    ends = []
    for _ in range(2):
        ends.append(beat(state))
        state, _ = secants.add(state, ends[-1])
    assert secants.extrapolated
    # what came of the leap: far away
    far = beat.state(beat.fixed + 10.0)
    back, distance = secants.add(state, far)
    assert distance == np.inf
    np.testing.assert_array_equal(back.p, ends[-1].p)
    assert not secants.extrapolated
    with pytest.raises(ValueError, match="no extrapolation"):
        secants.step_back()


def test_state_that_is_no_number_is_passed_on() -> None:
    beat = LinearBeat((0.8,), 5)
    state = beat.state(beat.start)
    secants = Secants(state, RATE, 8, NO_SIZES)
    state, _ = secants.add(state, beat(state))
    lost = State(state.R * np.nan, state.p * np.nan, state.V * np.nan, state.z)
    _, distance = secants.add(state, lost)
    assert not distance <= 1.0


def test_wing_in_vacuum_is_periodic_sooner_and_the_same() -> None:
    model = FlexibleWing(robird_wing(), "4", numerics=Numerics(steps=96, max_beats=60, periodic=2e-6))
    waiting = replace(model, numerics=replace(model.numerics, window=0))
    blank = blank_recording(model.wing, vacuum(0.01, 0.05, 3.0))
    nominal = [g.nominal for g in model.genes]
    quick, slow = model.beat(nominal, blank), waiting.beat(nominal, blank)
    assert quick.reason is None
    assert slow.reason is None
    assert quick.beats < 0.7 * slow.beats
    np.testing.assert_allclose(quick.tracks, slow.tracks, atol=2e-5)


def test_stiff_wing_with_little_damping_is_periodic_within_a_few_beats() -> None:
    """A corner of the gene box: two ringing modes, whose changes from beat to beat rise and fall."""
    model = FlexibleWing(robird_wing(), "4", numerics=Numerics(steps=144))
    factor = {"E_f": 5.0, "E_r": 5.0, "G_f": 5.0, "D_E": 0.2, "D_G": 0.2}
    genome = [gene.nominal * factor.get(gene.name, 1.0) for gene in model.genes]
    beat = model.beat(genome, blank_recording(model.wing, vacuum(10.0, 0.05, 4.0)))
    assert beat.reason is None
    assert beat.beats <= 10


def test_growth_is_that_of_transients_and_not_of_round_off() -> None:
    beats: Array = np.arange(16.0)
    noise: Array = np.random.default_rng(8).uniform(0.5, 2.0, 16)
    dead = 1e-8 * np.power(0.1, beats) + 1e-14 * noise
    assert _mean_growth(1e-9 * np.power(1.1, beats)) == pytest.approx(1.1)
    assert _mean_growth(1e-6 * np.power(0.9, beats)) == pytest.approx(0.9)
    assert _mean_growth(dead) == pytest.approx(1.0)


@pytest.mark.parametrize("largest", [0.0, 1e-9, 0.3, 1.9, 3.1, 3.1415926])
def test_coordinates_are_turns_displacements_and_twists_and_lead_back(largest: float) -> None:
    rng, rate, sizes = np.random.default_rng(2), 11.0, np.array([0.2, 3.0])
    bodies, n = 20, 22
    frames = Rotation.random(n, random_state=3)
    vectors = rng.uniform(-1, 1, (n, 3))
    vectors *= np.linspace(0, largest, n)[:, None] / np.linalg.norm(vectors, axis=1)[:, None]
    about = State(frames.as_matrix().reshape(n, 9), rng.normal(size=(n, 3)), rng.normal(size=(n, 6)), np.ones(2))
    turned = (frames * Rotation.from_rotvec(vectors)).as_matrix().reshape(n, 9)
    state = State(turned, rng.normal(size=(n, 3)), rng.normal(size=(n, 6)), np.array([0.5, -2.0]))

    found = np.empty(12 * bodies + 2)
    coordinates(about, state, rate, sizes, found)
    body = found[:-2].reshape(bodies, 12)
    np.testing.assert_allclose(body[:, :3], LENGTH * vectors[:bodies], rtol=0, atol=1e-13)
    np.testing.assert_allclose(body[:, 3:6], (state.p - about.p)[:bodies])
    np.testing.assert_allclose(body[:, 6:9], state.V[:bodies, :3] / rate * LENGTH)
    np.testing.assert_allclose(body[:, 9:], state.V[:bodies, 3:] / rate)
    np.testing.assert_allclose(found[-2:], [0.1, -6.0])

    back = State(*(array.copy() for array in about))
    displaced(about, found, rate, sizes, back)
    for own, other, rods in zip(back, state, about, strict=True):
        kept = bodies if len(own) == n else len(own)
        np.testing.assert_allclose(own[:kept], other[:kept], rtol=1e-13, atol=1e-13)
        np.testing.assert_array_equal(own[kept:], rods[kept:])
