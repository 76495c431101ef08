"""The deviance and its weight, convergence of fits, cross-validation, refits and discretisation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import numpy.typing as npt
import pytest

from tests.diagnosis.pendulum_rig import PendulumRig, recorded
from wingfit.calibration.estimates.linearised import free_genes, unit_at
from wingfit.calibration.problem import Problem, base_genome
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import (
    Fit,
    InitialSimulationError,
    _measure_columns,
    _Simulator,
    _step,
    gauss_newton_fit,
)
from wingfit.diagnosis.evidence.intervals import covariance
from wingfit.diagnosis.evidence.nominal import Nominal, finer_is_promising
from wingfit.diagnosis.evidence.refit import (
    cross_validated_excess,
    make_refit,
    refit_with,
    refit_without,
    substitute_trials,
)
from wingfit.diagnosis.evidence.screen import Nuisance, score_tests
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.policy import POLICY
from wingfit.diagnosis.search import _nominal_from_best, _search_coarse_first
from wingfit.diagnosis.search_state import SearchState
from wingfit.workers.in_process import InProcessEvaluator

Array = npt.NDArray[np.float64]

TRUTH = {"stiffness": 0.25, "damping": 3e-3, "inertia": 1.2e-3}
RIG, EVALUATOR = PendulumRig(), InProcessEvaluator()


def whitened_pendulum(noise: float = 5e-4, seed: int = 1, **hidden: float) -> WhitenedData:
    return WhitenedData.of(
        recorded({**TRUTH, **{k.replace("_", ".", 1): v for k, v in hidden.items()}}, noise=noise, seed=seed)
    )


def context(data: WhitenedData) -> FitContext:
    return FitContext(RIG, data, EVALUATOR)


def problem(data: WhitenedData, values: Mapping[str, float] | None = None) -> Problem:
    return Problem(RIG.model, data.recordings, RIG.model.searched, base_genome(RIG.model, values or {}), data.axes)


def start(own: Problem) -> Array:
    genes = free_genes(own)
    return unit_at(genes, np.array([own.base[gene.name] for gene in genes]))


def fit(data: WhitenedData, values: Mapping[str, float] | None = None) -> Fit:
    fitted_problem = problem(data, values)
    *_, found = gauss_newton_fit(context(data), fitted_problem, start(fitted_problem), 20)
    return found


@cache
def one() -> WhitenedData:
    return whitened_pendulum()


def test_deviance_is_chi_squared_within_noise_and_logarithmic_beyond() -> None:
    data = one()
    D, nu = len(data.scale), data.effective_samples
    assert nu == POLICY.effective_samples * len(data.recordings)
    direction = data.scale / np.sqrt(D)  # of chi-squared one
    for chi in (0.5 * D, D, D + 0.1 * nu, D + nu, 50.0 * D, 1e30 * D):
        beyond = max(chi - D, 0.0)
        coefficients = np.sqrt(chi) * direction
        assert float(data.deviance(coefficients)) == pytest.approx(min(chi, D) + nu * np.log1p(beyond / nu))
        assert data.likelihood_weight(coefficients) == pytest.approx(1.0 / (1.0 + beyond / nu))


def test_the_likelihood_weight_is_the_slope_of_the_deviance() -> None:
    data = one()
    direction = data.scale / np.sqrt(len(data.scale))
    for chi in (3.0 * len(data.scale), 40.0 * len(data.scale)):
        ends = [float(data.deviance(np.sqrt(chi + step) * direction)) for step in (-1.0, 1.0)]
        assert (ends[1] - ends[0]) / 2.0 == pytest.approx(data.likelihood_weight(np.sqrt(chi) * direction), rel=1e-6)


@pytest.mark.parametrize("corner", [0.02, 0.98])
def test_a_fit_recovers_the_truth_from_corners_of_the_box(corner: float) -> None:
    data = one()
    genes = [gene for gene in RIG.model.genes if gene.name in RIG.model.searched]
    found = fit(data, {gene.name: float(gene.from_unit(corner)) for gene in genes})
    assert found.converged
    assert data.chi_squared(found.coefficients) < 1.2 * len(data.scale)
    errors = np.sqrt(np.diag(covariance(data, found)))
    off = found.unit - unit_at(genes, np.array([TRUTH[gene.name] for gene in genes]))
    assert np.all(np.abs(off) < 4 * errors)


def test_missing_physics_does_not_push_genes_to_their_bounds() -> None:
    """A hardening spring almost without noise: chi-squared is in the thousands for each coefficient."""
    data = whitened_pendulum(noise=1e-5, cubic_k3=0.6)
    found = fit(data)
    assert data.chi_squared(found.coefficients) > 1000 * len(data.scale)
    assert found.unit.min() > 0.01
    assert found.unit.max() < 0.99


def test_intervals_include_model_error_and_tolerance() -> None:
    """Of one recording, which has no others to disagree with (test_intervals.py)."""
    data = WhitenedData.of(one().recordings[:1])
    found = fit(data)
    floor = POLICY.tolerance**2 * len(data.scale) / data.effective_samples
    assert data.max_likelihood_weight == pytest.approx(1.0 / (1.0 + floor))
    slopes = found.jacobian / data.scale[:, None]
    gram = slopes.T @ slopes
    prior = 4.0 * np.eye(len(gram))
    np.testing.assert_allclose(
        covariance(data, found), np.linalg.inv(data.max_likelihood_weight * gram + prior), rtol=1e-6
    )
    worse = replace(found, coefficients=10.0 * data.scale)
    likelihood_weight = data.likelihood_weight(worse.coefficients)
    np.testing.assert_allclose(covariance(data, worse), np.linalg.inv(likelihood_weight * gram + prior), rtol=1e-6)


def test_one_sided_and_central_differences_agree_at_a_bound() -> None:
    data = one()
    fitted_problem = problem(data)
    simulator, every = _Simulator(context(data), fitted_problem), np.ones(len(fitted_problem.free), bool)
    middle = fit(data)
    one_sided, central = (_measure_columns(simulator, middle, every, sides).jacobian for sides in (1, 2))
    assert np.linalg.norm(one_sided - central) < 0.05 * np.linalg.norm(central)
    unit = middle.unit.copy()
    unit[0] = 1.0
    at_end = replace(middle, unit=unit, coefficients=simulator.at(unit[None], unit)[0][0])
    one_sided, central = (_measure_columns(simulator, at_end, every, sides).jacobian for sides in (1, 2))
    assert np.isfinite(one_sided).all()
    assert np.linalg.norm(one_sided[:, 0] - central[:, 0]) < 0.05 * np.linalg.norm(central[:, 0])


def test_nuisance_genes_are_projected_out_within_their_prior() -> None:
    data = one()
    found = fit(data)
    nuisance, F = Nuisance(data, found), len(found.unit)
    moved = found.jacobian @ np.ones(F)
    whole = float(np.sum((moved / data.scale) ** 2))
    assert float(np.sum(nuisance.project_out(moved) ** 2)) <= 1.01 * 4.0 * F  # what the move costs by the prior
    assert whole > 100 * 4.0 * F
    doubted = Nuisance(data, replace(found, coefficients=30.0 * data.scale))
    assert np.sum(doubted.project_out(moved) ** 2) > 2 * np.sum(nuisance.project_out(moved) ** 2)


@pytest.mark.parametrize("seed", range(4))
def test_noise_alone_cross_validates_to_the_noise(seed: int) -> None:
    data = whitened_pendulum(seed=seed)
    found = fit(data)
    predicted_excess = cross_validated_excess(data, found)
    assert predicted_excess is not None
    assert predicted_excess - data.excess(found.coefficients) < 0.02 * data.noise**2


def test_missing_physics_cross_validates_worse_than_it_fits() -> None:
    data = whitened_pendulum(cubic_k3=0.6)
    found = fit(data)
    predicted_excess = cross_validated_excess(data, found)
    assert predicted_excess is not None
    assert predicted_excess > 1.02 * data.excess(found.coefficients)


def test_a_nominal_fit_leaves_a_local_minimum_by_a_hypothesis() -> None:
    """The hypothesis' own genes have no effect: it only reached the better minimum, and is not the cause."""
    data = one()
    good = fit(data)
    bad = replace(good, unit=np.full(len(good.unit), 0.9))
    simulator = _Simulator(context(data), good.problem)
    bad = replace(bad, coefficients=simulator.at(bad.unit[None], bad.unit)[0][0])
    caught = Nominal(RIG, make_refit(data, bad), None, "", ())
    state = SearchState(context(data), nominal=caught, refits=[make_refit(data, good)])
    found = _nominal_from_best(state)
    assert found is not None
    assert found.excess < 0.1 * caught.refit.excess
    own = make_refit(data, good)
    state = SearchState(context(data), nominal=Nominal(RIG, own, None, "", ()), refits=[own])
    assert _nominal_from_best(state) is None


@pytest.mark.parametrize(
    ("changes", "takes", "left", "expected"),
    [
        (0.5, 0.2, 2.0, True),
        (0.5, 0.05, 2.0, False),
        (3.0, 0.0, 2.0, True),
        (0.1, 0.9, 2.0, False),
        (3.0, 0.9, 0.1, False),
    ],
)
def test_a_finer_discretisation_is_fitted_where_promising(
    changes: float, takes: float, left: float, expected: int
) -> None:
    """It explains a fraction of the residual, or changes more than all of it, where the linearisation fails."""
    data, now = SimpleNamespace(noise=1.0, policy=POLICY), SimpleNamespace(excess=left**2)
    assert finer_is_promising(cast("Any", data), changes, takes, cast("Any", now)) == bool(expected)


@pytest.mark.parametrize(
    ("coarse", "expected", "taken"),
    [(0.1, ["coarse"], "coarse"), (0.9, ["coarse", "fine"], "fine"), (None, ["coarse", "fine"], "fine")],
)
def test_a_finer_discretisation_does_not_hide_an_effect(
    monkeypatch: pytest.MonkeyPatch, coarse: float | None, expected: list[str], taken: str
) -> None:
    """Suspects are tested with the coarse one first, which stays if one of them fits better than the finer one."""

    def found(subject: str, excess: float) -> Any:
        return SimpleNamespace(subject=subject, refit=SimpleNamespace(excess=excess), remaining_error=0.0)

    def tried(state: Any, *_: Any, **__: Any) -> Iterator[Any]:
        searched.append(state.subject)
        if coarse is not None:
            state.refits.append(SimpleNamespace(excess=coarse))
        yield 1.0, "tried"

    searched: list[str] = []
    fits = {False: found("coarse", 1.0), True: found("fine", 0.7)}
    monkeypatch.setattr("wingfit.diagnosis.search.choose_discretisation", lambda *_, refine: fits[refine])
    monkeypatch.setattr("wingfit.diagnosis.search._try_suspects", tried)
    monkeypatch.setattr("wingfit.diagnosis.search.nominal_suffices", lambda *_: False)
    state = SearchState(FitContext(*cast("Any", ("coarse", SimpleNamespace(policy=POLICY), None))))
    parts = [part for part, _ in _search_coarse_first(state, cast("Any", None), [])]
    assert searched == expected
    assert cast("Any", state.nominal).subject == taken
    assert cast("Any", state.subject) == taken
    assert parts == sorted(parts)


def test_geodesic_acceleration_follows_a_curved_valley() -> None:
    """Rosenbrock's valley: its floor is a parabola, and its walls limit a straight step."""

    def at(units: Array, near: Array) -> tuple[Array, tuple[None, ...], list[Array]]:  # noqa: ARG001
        u, v = units.T
        return np.stack([3e4 * (v - 3.0 * (u - 0.1) ** 2), 30.0 * (0.6 - u)], axis=1), (None,) * len(units), []

    def deviance(coefficients: Array) -> Array:
        return np.asarray((coefficients**2).sum(axis=-1))

    data = SimpleNamespace(
        likelihood_weight=lambda coefficients: 1.0,  # noqa: ARG005
        deviance=deviance,
        whiten=lambda coefficients: coefficients,
        whitened_slopes=lambda jacobian: jacobian,
    )
    simulator = cast(_Simulator, SimpleNamespace(context=SimpleNamespace(data=data), at=at))
    unit = np.array([0.1, 0.0])
    here = at(unit[None], unit)[0][0]
    slopes = np.array([[0.0, 3e4], [-30.0, 0.0]])
    cost = float(deviance(here) + 4.0 * ((unit - 0.5) ** 2).sum())
    fit = Fit(cast(Any, None), unit, here, slopes, (), cost, unit)
    (straight, _), (accelerated, _) = (_step(simulator, fit, accelerated=one) for one in (False, True))
    assert straight is not None
    assert accelerated is not None
    assert cost - accelerated.cost > 2.0 * (cost - straight.cost)


def test_substitutes_reproduce_the_contribution_of_an_effect() -> None:
    data = whitened_pendulum(friction_torque=2e-3, delay_time=4e-3)
    nominal = fit(data)
    found = [trials for _, trials in score_tests(context(data), nominal, RIG.suspects)]
    best = {trials[0].suspect.name: trials[0] for trials in found}
    both = refit_with(context(data), nominal, [best["friction"], best["delay"]])
    assert both is not None
    twin = replace(best["delay"], suspect=replace(best["delay"].suspect, name="twin"))
    offered = [*found, [twin]]
    assert substitute_trials(context(data), both, best["delay"], offered, 2) == [twin]
    assert substitute_trials(context(data), both, best["friction"], offered, 2) == []


def test_a_refit_without_one_of_its_effects_ends_where_one_of_the_others_alone_does() -> None:
    data = whitened_pendulum(friction_torque=2e-3, delay_time=4e-3)
    nominal = fit(data)
    best = {trials[0].suspect.name: trials[0] for _, trials in score_tests(context(data), nominal, RIG.suspects)}
    three = refit_with(context(data), nominal, [best["friction"], best["delay"], best["gain"]])
    two = refit_with(context(data), nominal, [best["friction"], best["delay"]])
    assert three is not None
    assert two is not None
    found = refit_without(context(data), three, best["gain"])
    assert found is not None
    assert found.names == two.names == ("friction", "delay")
    assert found.fit.problem.free == two.fit.problem.free
    np.testing.assert_allclose(found.fit.unit, two.fit.unit, atol=2e-3)
    assert found.fit.cost == pytest.approx(two.fit.cost, abs=0.1)
    assert three.fit.cost <= found.fit.cost + 0.1


def test_a_failed_subset_fit_does_not_end_a_refit(monkeypatch: pytest.MonkeyPatch) -> None:
    """A diverged refit is repeated with its size first; where that fails to start, the refit stays."""
    data = whitened_pendulum(point_mass_mass=5e-3, point_mass_station=0.5)
    nominal = fit(data)
    ((_, trials),) = score_tests(context(data), nominal, [one for one in RIG.suspects if one.name == "point_mass"])
    calls = []

    def fails(*arguments: Any) -> Fit:
        calls.append(arguments)
        raise InitialSimulationError("it flutters")

    data = replace(data, policy=replace(POLICY, diverged=0.0))
    monkeypatch.setattr("wingfit.diagnosis.evidence.refit._fit_subset", fails)
    assert refit_with(context(data), nominal, trials[:1]) is not None
    assert calls
