"""Extrapolation to the periodic motion: a linear map with a known fixed point, and the wing itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from sim.flexible_wing import FlexibleWing
from sim.kernels import LANES
from sim.kernels.integrate import State
from sim.periodic import extrapolate
from sim.rig import blank_recording, robird_wing, vacuum
from sim.simulate import Numerics

Array = npt.NDArray[np.float64]

BODIES, RATE = 2, 20.0


def state(place: Array, twist: Array) -> State:
    """Unturned bodies at ``place`` [n, 3, W] with ``twist`` [n, 6, W], and two driving rods."""
    R = np.zeros((BODIES + 2, 9, LANES))
    R[:, [0, 4, 8]] = 1.0
    rods = np.zeros((2, 6, LANES))
    return State(R, np.concatenate([place, rods[:, :3]]), np.concatenate([twist, rods]))


def beats(decay: Array, count: int, seed: int) -> tuple[list[State], State]:
    """States after successive beats of a map with as many decaying modes as ``decay``, and its fixed point."""
    rng = np.random.default_rng(seed)
    fixed = 1e-2 * rng.normal(size=(BODIES, 9, LANES))
    modes = 1e-3 * rng.normal(size=(len(decay), BODIES, 9, LANES))
    scale = np.concatenate([np.ones(3), np.full(6, RATE)])[None, :, None]
    found = []
    for k in range(count):
        x = (fixed + np.einsum("m,mniw->niw", decay**k, modes)) * scale
        found.append(state(x[:, :3], x[:, 3:]))
    return found, state((fixed * scale)[:, :3], (fixed * scale)[:, 3:])


def copied(from_: State) -> State:
    return State(*(array.copy() for array in from_))


@pytest.mark.parametrize("decay", [(0.8,), (0.7, -0.5), (0.8, 0.5, -0.3)])
def test_finds_the_fixed_point_with_as_many_beats_as_modes(decay: tuple[float, ...]) -> None:
    states, fixed = beats(np.array(decay), len(decay) + 2, 1)
    into = copied(states[-1])
    extrapolate(states, np.ones(LANES, bool), RATE, into)
    np.testing.assert_allclose(into.p, fixed.p, atol=1e-9)
    np.testing.assert_allclose(into.V, fixed.V, atol=1e-7)
    np.testing.assert_allclose(into.R, fixed.R, atol=1e-9)


def test_turns_decay_too() -> None:
    """Rotations about one axis add, so that their map is linear as well."""
    states, fixed = beats(np.array([0.6]), 3, 2)
    for k, s in enumerate(states):
        a = 0.05 * 0.6**k
        s.R[:BODIES] = np.array([1, 0, 0, 0, np.cos(a), -np.sin(a), 0, np.sin(a), np.cos(a)])[None, :, None]
    into = copied(states[-1])
    extrapolate(states, np.ones(LANES, bool), RATE, into)
    np.testing.assert_allclose(into.R, fixed.R, atol=1e-9)


def test_other_lanes_are_left_alone() -> None:
    states, fixed = beats(np.array([0.8]), 4, 3)
    into, chosen = copied(states[-1]), np.arange(LANES) == 2
    extrapolate(states, chosen, RATE, into)
    np.testing.assert_allclose(into.p[..., 2], fixed.p[..., 2], atol=1e-9)
    for found, before in zip(into, states[-1], strict=True):
        assert np.array_equal(found[..., ~chosen], before[..., ~chosen])


def test_a_leap_far_beyond_the_motion_is_refused() -> None:
    """A map that hardly contracts puts its fixed point a hundred beats' changes away: no map to be trusted."""
    states, _ = beats(np.array([0.99]), 4, 4)
    into = copied(states[-1])
    extrapolate(states, np.ones(LANES, bool), RATE, into)
    for found, before in zip(into, states[-1], strict=True):
        assert np.array_equal(found, before)


def test_lane_that_is_no_number_is_left_alone() -> None:
    states, fixed = beats(np.array([0.8]), 4, 5)
    for s in states:
        s.p[:, :, 1] = np.nan
    into = copied(states[-1])
    extrapolate(states, np.ones(LANES, bool), RATE, into)
    np.testing.assert_allclose(np.delete(into.p, 1, axis=2), np.delete(fixed.p, 1, axis=2), atol=1e-9)


def test_wing_in_vacuum_is_periodic_sooner_and_the_same() -> None:
    model = FlexibleWing(robird_wing(), "4", numerics=Numerics(steps=160, max_beats=60, periodic=5e-6))
    waiting = replace(model, numerics=replace(model.numerics, window=0))
    blank = blank_recording(model.wing, vacuum(0.01, 0.05, 3.0))
    nominal = [[g.nominal for g in model.genes]]
    quick, slow = model.beat(nominal, blank), waiting.beat(nominal, blank)
    assert quick.reasons == slow.reasons == (None,)
    assert quick.beats[0] < 0.8 * slow.beats[0]
    np.testing.assert_allclose(quick.tracks, slow.tracks, atol=1e-4)
