"""Steps of a fit on problems with a known minimum: updates and measurement of the Jacobian, acceleration, prior."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt
import pytest

from tests.diagnosis.closed_form import ClosedForm
from wingfit.diagnosis.evidence.fit import PRIOR_SD, Fit, InitialSimulationError, _broyden, _second_order, _step

Array = npt.NDArray[np.float64]

RNG = np.random.default_rng(0)
SLOPES, OFFSET = 30.0 * RNG.standard_normal((6, 3)), 5.0 * RNG.standard_normal(6)
AIM, START = np.array([0.3, 0.6, 0.7]), np.array([0.6, 0.4, 0.4])
ALL = np.ones(3, bool)


def linear(size: float = 1.0) -> tuple[ClosedForm, Array]:
    """Residuals of a given ``size``, linear in three genes, and the minimum of their squares and the prior."""
    slopes, offset = size * SLOPES, size * OFFSET
    normal = slopes.T @ slopes + np.eye(3) / PRIOR_SD**2
    best = np.linalg.solve(normal, slopes.T @ (slopes @ AIM - offset) + 0.5 / PRIOR_SD**2)
    return ClosedForm(lambda genes: (genes - AIM) @ slopes.T + offset, 3), best


def cost(rig: ClosedForm, unit: Array) -> float:
    """Sum of squares of the residuals and of the genes' prior."""
    return float((rig.residuals(unit[None]) ** 2).sum() + ((unit - 0.5) ** 2).sum() / PRIOR_SD**2)


def valley(steepness: float) -> ClosedForm:
    """Rosenbrock's valley: its floor is a parabola from (0.1, 0) to (0.6, 0.75)."""

    def residuals(genes: Array) -> Array:
        u, v = genes.T
        return np.stack([steepness * (v - 3.0 * (u - 0.1) ** 2), 30.0 * (0.6 - u)], axis=1)

    return ClosedForm(residuals, 2)


def test_updates_correct_an_inherited_jacobian() -> None:
    rig, best = linear()
    fit = rig.broyden_fit(START, SLOPES * [0.5, 2.0, 1.0], known=ALL)
    assert fit.converged
    assert fit.cost == pytest.approx(cost(rig, best), abs=0.05)
    assert len(rig.batches) < 8
    assert len(set(rig.sizes[1:])) == 1, "all batches are steps, without measurements"


def fit_at(rig: ClosedForm, unit: Array, jacobian: Array) -> Fit:
    """A fit at ``unit`` with a given Jacobian."""
    return Fit(rig.problem, unit, rig.residuals(unit[None])[0], jacobian, (), cost(rig, unit), unit)


def test_an_updated_jacobian_reproduces_the_step() -> None:
    rig, _ = linear()
    before = fit_at(rig, START, 0.5 * SLOPES)
    better, _ = _step(rig.simulator, before)
    assert better is not None
    np.testing.assert_allclose(
        better.jacobian @ (better.unit - START), better.coefficients - before.coefficients, rtol=1e-6
    )


def test_a_zero_step_leaves_the_jacobian() -> None:
    np.testing.assert_array_equal(_broyden(SLOPES, np.zeros(3), np.ones(6)), SLOPES)


def test_no_step_uphill_or_without_predicted_gain() -> None:
    rig, best = linear()
    assert _step(rig.simulator, fit_at(rig, START, -SLOPES)) == (None, 0.0)
    assert len(rig.batches) == 1
    assert _step(rig.simulator, fit_at(rig, best, SLOPES)) == (None, 0.0)
    assert len(rig.batches) == 1, "nothing is simulated without a predicted gain"


def test_damping_decreases_after_a_full_step() -> None:
    rig, _ = linear()
    before = fit_at(rig, START, SLOPES)
    better, _ = _step(rig.simulator, before)
    assert better is not None
    assert better.damping < before.damping, "the full step was the best"


def test_a_fit_from_the_minimum_converges_with_a_measured_jacobian() -> None:
    rig, best = linear()
    for jacobian in (None, 0.0 * SLOPES):
        rig.batches.clear()
        fit = rig.broyden_fit(best, jacobian, ALL)
        assert fit.converged
        assert fit.jacobian_measured
        np.testing.assert_allclose(fit.jacobian, SLOPES)
        assert rig.sizes.count(6) == 1, "both neighbours of three genes, once"


def test_only_known_columns_of_a_jacobian_are_used() -> None:
    for jacobian, known in ((0.0 * SLOPES, None), (None, ALL), (0.0 * SLOPES, ~ALL)):
        rig, best = linear()
        np.testing.assert_allclose(rig.broyden_fit(START, jacobian, known).unit, best, atol=1e-4)
        assert rig.sizes[:2] == [1, 6]


def test_new_columns_are_measured_again_before_all() -> None:
    """Two columns are exact; the third gene is strongly nonlinear."""

    def broyden_fit(third: Callable[[Array], Array]) -> tuple[Fit, list[int]]:
        def residuals(genes: Array) -> Array:
            return np.stack([30.0 * (genes[:, 0] - 0.4), 30.0 * (genes[:, 1] - 0.6), third(genes[:, 2])], axis=1)

        rig = ClosedForm(residuals, 3)
        fit = rig.broyden_fit(np.array([0.4, 0.6, 0.95]), np.diag([30.0, 30.0, 0.0]), np.array([True, True, False]))
        return fit, rig.sizes

    fit, sizes = broyden_fit(lambda gene: 30.0 * np.arctan(8.0 * (gene - 0.4)))
    assert (sizes[:2], sizes.count(2), sizes.count(6)) == ([1, 2], 2, 0), "its two neighbours, twice"
    np.testing.assert_allclose(fit.unit, [0.4, 0.6, 0.4], atol=2e-3)
    _, sizes = broyden_fit(lambda gene: 10.0 + 20.0 * np.abs(gene - 0.4) ** 0.5)
    assert sizes.count(6) <= 1, "all columns are measured at most once"


def test_all_columns_are_measured_again_at_most_once() -> None:
    """Steps towards a cusp never gain what is predicted."""
    rig = ClosedForm(lambda genes: 10.0 + 20.0 * np.abs(genes - 0.4) ** 0.5, 2)
    rig.broyden_fit(np.array([0.9, 0.7]))
    assert rig.sizes.count(4) == 2


def test_only_an_updated_jacobian_is_measured_again() -> None:
    rig, _ = linear()
    taught = rig.broyden_fit(START, 0.8 * SLOPES, ALL)
    assert not taught.jacobian_measured
    found = rig.with_measured_jacobian(taught)
    np.testing.assert_allclose(found.jacobian, SLOPES)
    evaluated = len(rig.batches)
    assert rig.with_measured_jacobian(found) is found
    assert len(rig.batches) == evaluated


def test_a_failed_start_names_genes_and_reason() -> None:
    rig = ClosedForm(lambda genes: genes, 2, reach=-1.0)
    with pytest.raises(
        InitialSimulationError, match=r"gene_0 = 0.25, gene_1 = 0.75\): it flutters; start from other genes"
    ):
        rig.broyden_fit(np.array([0.25, 0.75]))


def test_a_fit_converges_sooner_with_a_large_residual() -> None:
    """The tolerance is relative to the residual, which is a thousand times larger in one case."""

    def steps(left: float) -> int:
        rig = ClosedForm(lambda genes: np.hstack([10.0 * np.exp(3.0 * genes), np.full_like(genes, left)]), 1)
        fits = rig.gauss_newton_fit(np.array([0.95]), 30)
        assert fits[-1].converged
        return len(fits)

    assert steps(300.0) < steps(0.0)


@pytest.mark.parametrize("factors", [(1e3, 1e3, 1e3), (1.0, 0.0, 1e3)])
def test_the_jacobian_is_measured_where_steps_gain_less_than_predicted(factors: tuple[float, ...]) -> None:
    """Slopes that are far too steep predict large gains from tiny steps; that is no minimum."""
    rig, best = linear()
    fit = rig.broyden_fit(START, SLOPES * factors, known=ALL)
    np.testing.assert_allclose(fit.unit, best, atol=1e-4)
    assert sum(rig.sizes) < 40


def test_a_slow_fit_starts_geodesic_acceleration() -> None:
    rig = valley(3e4)
    fits = rig.gauss_newton_fit(np.array([0.1, 0.0]), 12)
    assert fits[-1].converged
    np.testing.assert_allclose(fits[-1].unit, [0.6, 0.75], atol=0.02)
    assert len(fits) < 8


def test_acceleration_is_the_second_derivative_along_a_step() -> None:
    def residuals(genes: Array) -> Array:
        return np.asarray(np.exp(genes @ np.array([[3.0, 1.0], [1.0, 4.0]])))

    rig, unit = ClosedForm(residuals, 2), np.array([0.3, 0.4])
    here = residuals(unit[None])[0]
    slopes = here[:, None] * np.array([[3.0, 1.0], [1.0, 4.0]])
    moves = np.array([[0.5, 0.2], [0.3, -0.1]])
    exact = 0.5 * here * (moves @ np.array([[3.0, 1.0], [1.0, 4.0]])) ** 2
    np.testing.assert_allclose(_second_order(rig.simulator, fit_at(rig, unit, slopes), moves), exact, rtol=0.05)


@pytest.mark.parametrize("steps", [1, 20])
def test_a_gauss_newton_fit_ends_with_central_differences(steps: int) -> None:
    """One-sided slopes in the valley have an error by its curvature; each is measured once."""
    rig = valley(3e4)
    fit = rig.gauss_newton_fit(np.array([0.1, 0.0]), steps)[-1]
    np.testing.assert_allclose(fit.jacobian, [[-1.8e5 * (fit.unit[0] - 0.1), 3e4], [-30.0, 0.0]], rtol=1e-6, atol=1e-3)
    assert not np.array_equal(rig.batches[-1], rig.batches[-2])
    assert rig.sizes[:2] == [1, 2], "one side is enough at first"


def test_an_unconverged_fit_has_central_differences_only_at_its_end() -> None:
    rig = ClosedForm(lambda genes: 10.0 * np.exp(3.0 * genes), 1)
    fit = rig.gauss_newton_fit(np.array([0.95]), 1)[-1]
    np.testing.assert_allclose(fit.jacobian, 30.0 * np.exp(3.0 * fit.unit[None]), rtol=1e-4)
    assert rig.sizes.count(1) == 3
    assert rig.sizes[-1] == 2


@pytest.mark.parametrize("end", [0.0, 1.0])
def test_a_fit_ends_at_the_bound_nearest_the_minimum(end: float) -> None:
    """The other gene compensates; its best value there has a closed form."""
    slopes, aim = np.array([[30.0, 20.0], [20.0, 30.0]]), np.array([1.4 * end - 0.2, 0.5])
    rig = ClosedForm(lambda genes: (genes - aim) @ slopes.T, 2)
    left = slopes[:, 0] * (end - aim[0]) - slopes[:, 1] * aim[1]
    other = (0.5 / PRIOR_SD**2 - slopes[:, 1] @ left) / (slopes[:, 1] @ slopes[:, 1] + 1.0 / PRIOR_SD**2)
    better, _ = _step(rig.simulator, fit_at(rig, np.array([0.5, 0.3]), slopes))
    assert better is not None
    np.testing.assert_allclose(better.unit, [end, other], atol=1e-4)
    assert better.unit[0] == end
    np.testing.assert_allclose(rig.gauss_newton_fit(np.array([0.5, 0.3]), 9)[-1].unit, [end, other], atol=1e-4)


def test_steps_do_not_depend_on_the_unit_of_the_data() -> None:
    def scaled(unit: float, genes: Array) -> Array:
        return unit * valley(3e4).residuals(genes)

    fits = []
    for unit in (1.0, 1e-3):
        rig = ClosedForm(partial(scaled, unit), 2, noise=unit)
        fits.append([fit.unit for fit in rig.gauss_newton_fit(np.array([0.1, 0.0]), 12)])
    np.testing.assert_allclose(fits[0], fits[1], atol=1e-6)


def test_the_initial_motion_follows_a_fit_that_moves_far() -> None:
    """Individuals farther than 0.3 from their initial motion fail; the minimum is at 0.89."""
    for known in (False, True):
        rig = ClosedForm(lambda genes: 10.0 * (genes - 0.9), 1, reach=0.3)
        start, slope = np.array([0.1]), np.array([[10.0]])
        fit = rig.broyden_fit(start, slope, np.array([True])) if known else rig.gauss_newton_fit(start, 12)[-1]
        np.testing.assert_allclose(fit.unit, 0.885, atol=5e-3)


def test_the_initial_motion_is_kept_while_a_fit_moves_little() -> None:
    rig = ClosedForm(lambda genes: 100.0 * (genes - 0.52), 1)
    rig.gauss_newton_fit(np.array([0.5]), 20)
    np.testing.assert_array_equal(rig.initial_motions, 0.5 * np.ones((len(rig.initial_motions), 1)))


@pytest.mark.parametrize("size", [0.0, 0.02, 0.1])
def test_weakly_identified_genes_end_between_data_and_prior(size: float) -> None:
    """The minimum of residuals and prior is known; at a size of zero it is the middle of every box."""
    rig, best = linear(size)
    assert size or best.tolist() == [0.5] * 3
    for fit in (rig.gauss_newton_fit(START, 20)[-1], rig.broyden_fit(START)):
        assert fit.converged
        np.testing.assert_allclose(fit.unit, best, atol=0.02)
