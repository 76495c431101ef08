"""Steps of a fit on problems whose minimum is known: updates of the Jacobian, its measurement, bends, the prior."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from diagnosis.fit import PRIOR, Fit, _step
from tests.diagnosis.closed_form import ClosedForm

Array = npt.NDArray[np.float64]

RNG = np.random.default_rng(0)
SLOPES, OFFSET = 30.0 * RNG.standard_normal((6, 3)), 5.0 * RNG.standard_normal(6)
AIM, START = np.array([0.3, 0.6, 0.7]), np.array([0.6, 0.4, 0.4])
ALL = np.ones(3, bool)


def linear(size: float = 1.0) -> tuple[ClosedForm, Array]:
    """Residuals of some ``size``, linear in three genes, and where their squares and the prior have their minimum."""
    slopes, offset = size * SLOPES, size * OFFSET
    normal = slopes.T @ slopes + np.eye(3) / PRIOR**2
    best = np.linalg.solve(normal, slopes.T @ (slopes @ AIM - offset) + 0.5 / PRIOR**2)
    return ClosedForm(lambda genes: (genes - AIM) @ slopes.T + offset, 3), best


def cost(rig: ClosedForm, unit: Array) -> float:
    """Sum of squares of the residuals and of the genes' distances from the middle of their boxes, by the prior."""
    return float((rig.residuals(unit[None]) ** 2).sum() + ((unit - 0.5) ** 2).sum() / PRIOR**2)


def valley(steepness: float) -> ClosedForm:
    """Rosenbrock's valley: its floor is a parabola that leads from (0.1, 0) to (0.6, 0.75)."""

    def residuals(genes: Array) -> Array:
        u, v = genes.T
        return np.stack([steepness * (v - 3.0 * (u - 0.1) ** 2), 30.0 * (0.6 - u)], axis=1)

    return ClosedForm(residuals, 2)


def test_steps_correct_a_jacobian_that_was_taken_over_wrong_by_factors() -> None:
    rig, best = linear()
    fit = rig.fitted(START, SLOPES * [0.5, 2.0, 1.0], known=ALL)
    assert fit.converged
    assert fit.cost == pytest.approx(cost(rig, best), abs=0.05)
    assert len(rig.batches) < 8
    assert len(set(rig.batches[1:])) == 1, "all batches are steps: nothing had to be measured"


def test_after_a_step_the_jacobian_predicts_that_step() -> None:
    rig, _ = linear()
    at = rig.residuals(START[None])[0]
    begun = Fit(rig.problem, START, at, 0.5 * SLOPES, (), cost(rig, START), START)
    better, _ = _step(rig.look, begun)
    assert better is not None
    np.testing.assert_allclose(better.jacobian @ (better.unit - START), better.coefficients - at)


@pytest.mark.parametrize("factors", [(1e3, 1e3, 1e3), (1.0, 0.0, 1e3)])
def test_where_steps_gain_far_less_than_promised_the_jacobian_is_measured(factors: tuple[float, ...]) -> None:
    """Slopes that are far too steep promise everything and move nothing: that is not the minimum."""
    rig, best = linear()
    fit = rig.fitted(START, SLOPES * factors, known=ALL)
    np.testing.assert_allclose(fit.unit, best, atol=1e-4)
    assert sum(rig.batches) < 40


def test_a_fit_that_crawls_along_a_bent_valley_begins_to_follow_its_bend() -> None:
    rig = valley(3e4)
    fits = rig.thoroughly(np.array([0.1, 0.0]), 12)
    assert fits[-1].converged
    np.testing.assert_allclose(fits[-1].unit, [0.6, 0.75], atol=0.02)
    assert len(fits) < 8


def test_individuals_begin_beside_a_fit_that_has_moved_far() -> None:
    """Whatever is farther than 0.3 from the motion that it begins beside fails; the minimum is at 0.89."""
    rig = ClosedForm(lambda genes: 10.0 * (genes - 0.9), 1, reach=0.3)
    *_, fit = rig.thoroughly(np.array([0.1]), 12)
    np.testing.assert_allclose(fit.unit, 0.885, atol=5e-3)


def test_individuals_begin_beside_one_and_the_same_motion_while_a_fit_moves_little() -> None:
    rig = ClosedForm(lambda genes: 100.0 * (genes - 0.52), 1)
    rig.thoroughly(np.array([0.5]), 20)
    np.testing.assert_array_equal(rig.near, 0.5 * np.ones((len(rig.near), 1)))


@pytest.mark.parametrize("size", [0.0, 0.02, 0.1])
def test_genes_that_the_data_hardly_determine_end_between_data_and_prior(size: float) -> None:
    """The minimum of residuals and prior together is known: at a size of zero the middle of every box."""
    rig, best = linear(size)
    assert size or best.tolist() == [0.5] * 3
    for fit in (rig.thoroughly(START, 20)[-1], rig.fitted(START)):
        assert fit.converged
        np.testing.assert_allclose(fit.unit, best, atol=0.02)
