from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.sim.wing.springs import Pair, load

seeds = st.integers(0, 2**32 - 1)


def random_pair(seed: int, *, moving: bool = False, damped: bool = False) -> Pair:
    rng = np.random.default_rng(seed)
    stiffness = np.exp(rng.uniform(-2, 6, 6)) * np.array([1, 1, 1, 1e3, 1e3, 1e3])
    coupling = rng.normal(size=(3, 3)) * np.sqrt(stiffness[:3, None] * stiffness[None, 3:])
    return Pair(
        turn=rng.uniform(-1, 1, (2, 3)),
        place=rng.uniform(-0.1, 0.1, (2, 3)),
        twist=rng.normal(size=(2, 6)) if moving else np.zeros((2, 6)),
        a=rng.uniform(-0.05, 0.05, 3),
        b=rng.uniform(-0.05, 0.05, 3),
        K=stiffness,
        D=stiffness * 1e-3 if damped else np.zeros(6),
        coupling=0.5 * (coupling + coupling.T) if seed % 4 else None,
    )


@given(seeds)
@settings(max_examples=60, deadline=None)
def test_spring_wrench_is_minus_the_gradient_of_its_energy(seed: int) -> None:
    pair, h = random_pair(seed), 1e-6
    wrench, _, _ = load(pair)
    gradient = np.array(
        [[(load(pair.moved(n, k, h))[2] - load(pair.moved(n, k, -h))[2]) / (2 * h) for k in range(6)] for n in range(2)]
    )
    np.testing.assert_allclose(wrench, -gradient, atol=1e-7 * (1 + np.abs(wrench).max()) + 1e-9 * pair.K.max())


@given(seeds)
@settings(max_examples=60, deadline=None)
def test_wrenches_on_the_two_bodies_balance(seed: int) -> None:
    pair = random_pair(seed, moving=True, damped=True)
    wrench, _, _ = load(pair)
    rotations = [Rotation.from_rotvec(t) for t in pair.turn]
    force = [r.apply(w[3:]) for r, w in zip(rotations, wrench, strict=True)]
    moment = [r.apply(w[:3]) + np.cross(p, f) for r, w, p, f in zip(rotations, wrench, pair.place, force, strict=True)]
    np.testing.assert_allclose(force[0] + force[1], 0, atol=1e-9 * np.abs(force).max())
    np.testing.assert_allclose(moment[0] + moment[1], 0, atol=1e-9 * (np.abs(moment).max() + np.abs(force).max()))


@given(seeds)
@settings(max_examples=60, deadline=None)
def test_damper_takes_exactly_the_power_that_the_bodies_lose(seed: int) -> None:
    pair = random_pair(seed, moving=True, damped=True)
    wrench, lost, _ = load(replace(pair, K=pair.K * 0, coupling=None))
    assert lost >= 0
    np.testing.assert_allclose((wrench * pair.twist).sum(), -lost, rtol=1e-9)


def test_small_displacements_see_the_stiffness_itself() -> None:
    K = np.array([3.0, 5.0, 7.0, 1e3, 2e3, 4e3])
    rest = Pair(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((2, 6)), np.zeros(3), np.zeros(3), K, np.zeros(6))
    assert load(rest)[2] == 0
    for axis in range(6):
        wrench, _, energy = load(rest.moved(1, axis, 1e-4))
        np.testing.assert_allclose(wrench[1, axis], -K[axis] * 1e-4, rtol=1e-6)
        np.testing.assert_allclose(energy, 0.5 * K[axis] * 1e-8, rtol=1e-6)


def test_coupling_joins_small_rotations_and_displacements() -> None:
    """V_c = phi . K_c d: a displacement makes a moment and a rotation makes a force, through the same K_c."""
    K = np.array([3.0, 5.0, 7.0, 1e3, 2e3, 4e3])
    coupling = np.array([[10.0, 2.0, -3.0], [2.0, -4.0, 5.0], [-3.0, 5.0, 6.0]])
    rest = Pair(
        np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((2, 6)), np.zeros(3), np.zeros(3), K, np.zeros(6), coupling
    )
    assert load(rest)[2] == 0
    for axis in range(3):
        turned, _, _ = load(rest.moved(1, axis, 1e-5))
        np.testing.assert_allclose(turned[1, 3:], -coupling[:, axis] * 1e-5, rtol=1e-4)
        shifted, _, _ = load(rest.moved(1, 3 + axis, 1e-5))
        np.testing.assert_allclose(shifted[1, :3], -coupling[axis] * 1e-5, rtol=1e-4)
    both = rest.moved(1, 0, 1e-4).moved(1, 4, 1e-4)
    np.testing.assert_allclose(load(both)[2], 0.5 * (K[0] + K[4]) * 1e-8 + coupling[0, 1] * 1e-8, rtol=1e-3)


def test_coupling_is_symmetric_in_the_bodies() -> None:
    """Turning both bodies and their places together changes neither energy nor the wrenches in body axes."""
    pair = random_pair(1)
    assert pair.coupling is not None
    turn = Rotation.from_rotvec([0.3, -0.7, 0.4])
    moved = replace(
        pair,
        turn=np.array([(turn * Rotation.from_rotvec(t)).as_rotvec() for t in pair.turn]),
        place=turn.apply(pair.place) + np.array([0.2, 0.1, -0.3]),
    )
    np.testing.assert_allclose(load(moved)[0], load(pair)[0], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(load(moved)[2], load(pair)[2], rtol=1e-9)
