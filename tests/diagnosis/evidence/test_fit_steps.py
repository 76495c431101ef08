"""Steps of a fit on problems whose minimum is known: updates of the Jacobian, its measurement, bends, the prior."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt
import pytest

from tests.diagnosis.closed_form import ClosedForm
from wingfit.diagnosis.evidence.fit import PRIOR_SD, Fit, InitialSimulationError, _accelerations, _broyden, _step

Array = npt.NDArray[np.float64]

RNG = np.random.default_rng(0)
SLOPES, OFFSET = 30.0 * RNG.standard_normal((6, 3)), 5.0 * RNG.standard_normal(6)
AIM, START = np.array([0.3, 0.6, 0.7]), np.array([0.6, 0.4, 0.4])
ALL = np.ones(3, bool)


def linear(size: float = 1.0) -> tuple[ClosedForm, Array]:
    """Residuals of some ``size``, linear in three genes, and where their squares and the prior have their minimum."""
    slopes, offset = size * SLOPES, size * OFFSET
    normal = slopes.T @ slopes + np.eye(3) / PRIOR_SD**2
    best = np.linalg.solve(normal, slopes.T @ (slopes @ AIM - offset) + 0.5 / PRIOR_SD**2)
    return ClosedForm(lambda genes: (genes - AIM) @ slopes.T + offset, 3), best


def cost(rig: ClosedForm, unit: Array) -> float:
    """Sum of squares of the residuals and of the genes' distances from the middle of their boxes, by the prior."""
    return float((rig.residuals(unit[None]) ** 2).sum() + ((unit - 0.5) ** 2).sum() / PRIOR_SD**2)


def valley(steepness: float) -> ClosedForm:
    """Rosenbrock's valley: its floor is a parabola that leads from (0.1, 0) to (0.6, 0.75)."""

    def residuals(genes: Array) -> Array:
        u, v = genes.T
        return np.stack([steepness * (v - 3.0 * (u - 0.1) ** 2), 30.0 * (0.6 - u)], axis=1)

    return ClosedForm(residuals, 2)


def test_steps_correct_a_jacobian_that_was_taken_over_wrong_by_factors() -> None:
    rig, best = linear()
    fit = rig.broyden_fit(START, SLOPES * [0.5, 2.0, 1.0], known=ALL)
    assert fit.converged
    assert fit.cost == pytest.approx(cost(rig, best), abs=0.05)
    assert len(rig.batches) < 8
    assert len(set(rig.sizes[1:])) == 1, "all batches are steps: nothing had to be measured"


def fit_at(rig: ClosedForm, unit: Array, jacobian: Array) -> Fit:
    """A fit that has come to ``unit`` with some Jacobian."""
    return Fit(rig.problem, unit, rig.residuals(unit[None])[0], jacobian, (), cost(rig, unit), unit)


def test_after_a_step_the_jacobian_predicts_that_step() -> None:
    rig, _ = linear()
    before = fit_at(rig, START, 0.5 * SLOPES)
    better, _ = _step(rig.simulator, before)
    assert better is not None
    np.testing.assert_allclose(
        better.jacobian @ (better.unit - START), better.coefficients - before.coefficients, rtol=1e-6
    )


def test_a_move_of_no_length_teaches_the_jacobian_nothing() -> None:
    np.testing.assert_array_equal(_broyden(SLOPES, np.zeros(3), np.ones(6)), SLOPES)


def test_a_step_is_none_where_all_lead_uphill_and_where_none_promises_anything() -> None:
    rig, best = linear()
    assert _step(rig.simulator, fit_at(rig, START, -SLOPES)) == (None, 0.0)
    assert len(rig.batches) == 1
    assert _step(rig.simulator, fit_at(rig, best, SLOPES)) == (None, 0.0)
    assert len(rig.batches) == 1, "nothing is simulated where nothing can be gained"


def test_steps_are_damped_as_those_before_had_to_be() -> None:
    rig, _ = linear()
    before = fit_at(rig, START, SLOPES)
    better, _ = _step(rig.simulator, before)
    assert better is not None
    assert better.damping < before.damping, "the full step was the best"


def test_a_fit_that_begins_at_the_minimum_ends_there_with_slopes_that_were_measured() -> None:
    rig, best = linear()
    for jacobian in (None, 0.0 * SLOPES):
        rig.batches.clear()
        fit = rig.broyden_fit(best, jacobian, ALL)
        assert fit.converged
        assert fit.jacobian_measured
        np.testing.assert_allclose(fit.jacobian, SLOPES)
        assert rig.sizes.count(6) == 1, "both neighbours of three genes, once"


def test_a_jacobian_counts_only_where_it_is_said_to_be_known() -> None:
    for jacobian, known in ((0.0 * SLOPES, None), (None, ALL), (0.0 * SLOPES, ~ALL)):
        rig, best = linear()
        np.testing.assert_allclose(rig.broyden_fit(START, jacobian, known).unit, best, atol=1e-4)
        assert rig.sizes[:2] == [1, 6]


def test_slopes_of_genes_that_are_new_are_measured_first_and_again_before_those_of_all() -> None:
    """Two genes are known well; what the third does is far from linear."""

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
    assert sizes.count(6) <= 1, "at most once all are measured, whatever steps gain"


def test_all_slopes_are_measured_at_most_once_again() -> None:
    """Steps towards a cusp never keep their promise."""
    rig = ClosedForm(lambda genes: 10.0 + 20.0 * np.abs(genes - 0.4) ** 0.5, 2)
    rig.broyden_fit(np.array([0.9, 0.7]))
    assert rig.sizes.count(4) == 2


def test_a_fit_whose_slopes_steps_have_taught_is_measured_where_it_ended_and_no_other() -> None:
    rig, _ = linear()
    taught = rig.broyden_fit(START, 0.8 * SLOPES, ALL)
    assert not taught.jacobian_measured
    found = rig.with_measured_jacobian(taught)
    np.testing.assert_allclose(found.jacobian, SLOPES)
    evaluated = len(rig.batches)
    assert rig.with_measured_jacobian(found) is found
    assert len(rig.batches) == evaluated


def test_a_fit_that_cannot_begin_says_where_and_why() -> None:
    rig = ClosedForm(lambda genes: genes, 2, reach=-1.0)
    with pytest.raises(
        InitialSimulationError, match=r"gene_0 = 0.25, gene_1 = 0.75\): it flutters; start from other genes"
    ):
        rig.broyden_fit(np.array([0.25, 0.75]))


def test_a_fit_ends_sooner_where_much_is_left() -> None:
    """What a step gains counts as a part of the misfit: here a thousand times as large in one case."""

    def steps(left: float) -> int:
        rig = ClosedForm(lambda genes: np.hstack([10.0 * np.exp(3.0 * genes), np.full_like(genes, left)]), 1)
        fits = rig.gauss_newton_fit(np.array([0.95]), 30)
        assert fits[-1].converged
        return len(fits)

    assert steps(300.0) < steps(0.0)


@pytest.mark.parametrize("factors", [(1e3, 1e3, 1e3), (1.0, 0.0, 1e3)])
def test_where_steps_gain_far_less_than_promised_the_jacobian_is_measured(factors: tuple[float, ...]) -> None:
    """Slopes that are far too steep promise everything and move nothing: that is not the minimum."""
    rig, best = linear()
    fit = rig.broyden_fit(START, SLOPES * factors, known=ALL)
    np.testing.assert_allclose(fit.unit, best, atol=1e-4)
    assert sum(rig.sizes) < 40


def test_a_fit_that_crawls_along_a_bent_valley_begins_to_follow_its_bend() -> None:
    rig = valley(3e4)
    fits = rig.gauss_newton_fit(np.array([0.1, 0.0]), 12)
    assert fits[-1].converged
    np.testing.assert_allclose(fits[-1].unit, [0.6, 0.75], atol=0.02)
    assert len(fits) < 8


def test_a_bend_is_the_second_derivative_along_a_step_and_measured_near() -> None:
    def residuals(genes: Array) -> Array:
        return np.asarray(np.exp(genes @ np.array([[3.0, 1.0], [1.0, 4.0]])))

    rig, unit = ClosedForm(residuals, 2), np.array([0.3, 0.4])
    here = residuals(unit[None])[0]
    slopes = here[:, None] * np.array([[3.0, 1.0], [1.0, 4.0]])
    moves = np.array([[0.5, 0.2], [0.3, -0.1]])
    exact = 0.5 * here * (moves @ np.array([[3.0, 1.0], [1.0, 4.0]])) ** 2
    np.testing.assert_allclose(_accelerations(rig.simulator, fit_at(rig, unit, slopes), moves), exact, rtol=0.05)


@pytest.mark.parametrize("steps", [1, 20])
def test_slopes_are_central_differences_where_a_thorough_fit_ends(steps: int) -> None:
    """In the valley those of one side are off by a part of its bend; each is measured once."""
    rig = valley(3e4)
    fit = rig.gauss_newton_fit(np.array([0.1, 0.0]), steps)[-1]
    np.testing.assert_allclose(fit.jacobian, [[-1.8e5 * (fit.unit[0] - 0.1), 3e4], [-30.0, 0.0]], rtol=1e-6, atol=1e-3)
    assert not np.array_equal(rig.batches[-1], rig.batches[-2])
    assert rig.sizes[:2] == [1, 2], "one side is enough at first"


def test_a_thorough_fit_that_steps_do_not_suffice_for_has_slopes_of_one_side_till_its_last() -> None:
    rig = ClosedForm(lambda genes: 10.0 * np.exp(3.0 * genes), 1)
    fit = rig.gauss_newton_fit(np.array([0.95]), 1)[-1]
    np.testing.assert_allclose(fit.jacobian, 30.0 * np.exp(3.0 * fit.unit[None]), rtol=1e-4)
    assert rig.sizes.count(1) == 3
    assert rig.sizes[-1] == 2


@pytest.mark.parametrize("end", [0.0, 1.0])
def test_a_fit_ends_at_a_bound_of_a_box_where_the_minimum_is_beyond_it(end: float) -> None:
    """The other gene makes up for it: its best value there has a closed form."""
    slopes, aim = np.array([[30.0, 20.0], [20.0, 30.0]]), np.array([1.4 * end - 0.2, 0.5])
    rig = ClosedForm(lambda genes: (genes - aim) @ slopes.T, 2)
    left = slopes[:, 0] * (end - aim[0]) - slopes[:, 1] * aim[1]
    other = (0.5 / PRIOR_SD**2 - slopes[:, 1] @ left) / (slopes[:, 1] @ slopes[:, 1] + 1.0 / PRIOR_SD**2)
    better, _ = _step(rig.simulator, fit_at(rig, np.array([0.5, 0.3]), slopes))
    assert better is not None
    np.testing.assert_allclose(better.unit, [end, other], atol=1e-4)
    assert better.unit[0] == end
    np.testing.assert_allclose(rig.gauss_newton_fit(np.array([0.5, 0.3]), 9)[-1].unit, [end, other], atol=1e-4)


def test_no_step_depends_on_the_unit_of_what_is_recorded() -> None:
    def scaled(unit: float, genes: Array) -> Array:
        return unit * valley(3e4).residuals(genes)

    fits = []
    for unit in (1.0, 1e-3):
        rig = ClosedForm(partial(scaled, unit), 2, noise=unit)
        fits.append([fit.unit for fit in rig.gauss_newton_fit(np.array([0.1, 0.0]), 12)])
    np.testing.assert_allclose(fits[0], fits[1], atol=1e-6)


def test_individuals_begin_beside_a_fit_that_has_moved_far() -> None:
    """Whatever is farther than 0.3 from the motion that it begins beside fails; the minimum is at 0.89."""
    for known in (False, True):
        rig = ClosedForm(lambda genes: 10.0 * (genes - 0.9), 1, reach=0.3)
        start, slope = np.array([0.1]), np.array([[10.0]])
        fit = rig.broyden_fit(start, slope, np.array([True])) if known else rig.gauss_newton_fit(start, 12)[-1]
        np.testing.assert_allclose(fit.unit, 0.885, atol=5e-3)


def test_individuals_begin_beside_one_and_the_same_motion_while_a_fit_moves_little() -> None:
    rig = ClosedForm(lambda genes: 100.0 * (genes - 0.52), 1)
    rig.gauss_newton_fit(np.array([0.5]), 20)
    np.testing.assert_array_equal(rig.initial_motions, 0.5 * np.ones((len(rig.initial_motions), 1)))


@pytest.mark.parametrize("size", [0.0, 0.02, 0.1])
def test_genes_that_the_data_hardly_determine_end_between_data_and_prior(size: float) -> None:
    """The minimum of residuals and prior together is known: at a size of zero the middle of every box."""
    rig, best = linear(size)
    assert size or best.tolist() == [0.5] * 3
    for fit in (rig.gauss_newton_fit(START, 20)[-1], rig.broyden_fit(START)):
        assert fit.converged
        np.testing.assert_allclose(fit.unit, best, atol=0.02)
