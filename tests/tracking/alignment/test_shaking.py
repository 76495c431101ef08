"""Motion that all tracks share, as of cameras that shake, must not decide which side a wing is on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.oracles.alignment import grid_wing, rigid, tracks_of
from wingfit import DatasetError
from wingfit.records import Wing
from wingfit.records.array_types import Array, Mask
from wingfit.tracking.alignment import Known, Tracks, align
from wingfit.tracking.alignment.arrangements import Costs, sure_of
from wingfit.tracking.alignment.shake import body_part, jitter_costs, jitter_precision, shake_of

FRAMES, MARKERS = 4000, 30
NOISE = 5e-4  # m
STEADY = 1e-14 * np.eye(5)
MEMORY = 4.0


def common(shake: float, pose: float = 0.0, seed: int = 0) -> tuple[Array, Mask]:
    """Return residuals [T, M, 3] of independent noise and a common shift, and the samples that are seen."""
    rng = np.random.default_rng(seed)
    each = NOISE * rng.standard_normal((FRAMES, MARKERS, 3))
    each += np.hypot(shake, pose) * rng.standard_normal((FRAMES, 1, 3))
    return each, rng.uniform(size=each.shape[:2]) < 0.9


def estimated(residuals: Array, seen: Mask, pose: Array, memory: float = 1.0) -> float:
    jitter, x = np.zeros((FRAMES, 5)), np.linspace(0.0, 0.2, MARKERS)
    return shake_of(residuals, seen, x, jitter, pose, NOISE, memory)


def test_the_size_of_shake_is_estimated_and_noise_is_none() -> None:
    assert estimated(*common(4e-4), STEADY) == pytest.approx(4e-4, rel=0.05)
    assert estimated(*common(0.0), STEADY, MEMORY) == 0.0
    pose = STEADY + np.diag([0.0, 0.0, 9e-8, 9e-8, 9e-8])
    assert estimated(*common(4e-4, 3e-4), pose) == pytest.approx(4e-4, rel=0.07)


def test_only_the_bodys_part_of_the_jitter_is_removed() -> None:
    """Checked by simulation: the regression of the body's motion on the sum."""
    rng = np.random.default_rng(2)
    pose = np.diag([1e-6, 1e-6, 4e-8, 9e-8, 1e-8])
    body = rng.standard_normal((200_000, 5)) * np.sqrt(np.diag(pose))
    shift = 2e-4 * rng.standard_normal((len(body), 5)) * [0.0, 0.0, 1.0, 1.0, 1.0]
    expected = body_part(body + shift, pose, 2e-4, 1.0)
    assert (np.abs((expected * (body - expected)).mean(axis=0)) < 0.01 * (expected**2).mean(axis=0)).all()
    assert np.abs(body_part(shift, STEADY, 2e-4, 1.0)).max() < 1e-9


def test_costs_of_the_jitter_are_those_of_the_integral() -> None:
    """One state and the jitter: -2 ln of the integral of likelihood times prior, over that of the state alone."""
    rng = np.random.default_rng(3)
    J: Array = rng.standard_normal((20, 6))
    y, precision = rng.standard_normal(20), jitter_precision(0.09 * np.eye(5), 0.4, 1.0)
    prior = np.zeros((6, 6))
    prior[1:, 1:] = precision
    normal = J.T @ J + prior
    best: Array = np.asarray(np.linalg.solve(normal, J.T @ y), dtype=float)
    found = ((y - J @ best) ** 2).sum() + jitter_costs(best[None, 1:], precision, normal[None], 1.0)[0]
    spread = np.eye(20) + J[:, 1:] @ np.linalg.inv(precision) @ J[:, 1:].T
    whitened = np.linalg.inv(np.linalg.cholesky(spread))
    a, b = whitened @ J[:, 0], whitened @ y
    alone = (b**2).sum() - (a @ b) ** 2 / (a @ a) + np.linalg.slogdet(spread)[1]
    assert found == pytest.approx(alone + np.log(a @ a) - np.log(J[:, 0] @ J[:, 0]), rel=1e-9)


def test_odds_are_at_most_those_of_the_scatter_between_frames() -> None:
    """Two models that explain frames equally well on average: a difference that chance makes must not be sure."""
    rng, sure, likelihoods = np.random.default_rng(4), 0, 0
    for _ in range(400):
        each = np.repeat(20 * rng.standard_normal(30), 4)  # neighbours share their errors
        costs = [Costs(np.zeros(len(each)), 0.0), Costs(each, 0.0)]
        less, more = sorted(costs, key=lambda one: one.total)
        sure += sure_of(less, more, MEMORY) > 12.0
        likelihoods += more.total - less.total > 12.0
    assert likelihoods > 360
    assert sure <= 12  # about 0.5 % of them, two-sided, and more as the scatter is estimated
    steady = Costs(np.full(120, 0.5) + 0.01 * rng.standard_normal(120), 3.0)
    assert sure_of(Costs(np.zeros(120), 0.0), steady, MEMORY) == pytest.approx(steady.total)


def answer(tracks: Tracks, wing: Wing) -> str:
    try:
        return align(tracks, wing, Known()).side
    except DatasetError as error:
        return str(error)


@pytest.mark.parametrize("seed", [1, 4])
def test_shaking_cameras_do_not_make_a_left_wing_of_a_right_one(seed: int) -> None:
    """Markers 1.5 mm above the hinge's plane, 1.2 mm of shake: taken for independent errors, it was sure of "left"."""
    flat = grid_wing(4, flat=True, symmetric=False)
    wing = replace(flat, markers=tuple(replace(one, position=(*one.position[:2], 1.5e-3)) for one in flat.markers))
    positions = rigid(wing, seed=seed)
    positions += 1.2e-3 * np.random.default_rng(100 + seed).standard_normal((len(positions), 1, 3))
    tracks = replace(tracks_of(positions), names=tuple(one.name for one in wing.markers))
    found = answer(tracks, wing)
    assert found == "right" or "a left and a right wing explain the tracks nearly equally well" in found
    assert align(tracks, wing, Known(side="right")).side == "right"
