from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize

from tests.calibration.linear import TRUTH, Linear, problem, recorded
from tests.workers import pendulum
from wingfit.calibration.estimates.likelihood import Step, estimate, iterate
from wingfit.calibration.estimates.linearised import SHORTER
from wingfit.calibration.estimates.uncertainty import uncertainty
from wingfit.calibration.problem import Problem, base_genome, compared, misfit
from wingfit.inference.differences import STEP
from wingfit.records import Dataset, Genome, Recording
from wingfit.sim.model import Array, Observation
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.solver.settle import Course, Subject
from wingfit.sim.solver.simulate import settled_course
from wingfit.sim.wing import flexible_wing
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.workers.in_process import InProcessEvaluator

HERE = InProcessEvaluator()
MIX = np.array([[0.03, 0.012], [0.0, 0.006]])  # noise of two axes that differ and go together


def white(samples: int = 400, axes: int = 1, seed: int = 1) -> Array:
    draws = np.random.default_rng(seed).normal(size=(samples, axes))
    return np.asarray(draws @ (MIX if axes == 2 else np.array([[0.03]])))


def run(given: Problem, start: dict[str, float] | None = None) -> list[Step]:
    return list(iterate(given, HERE, start or {}))


def test_one_axis_of_a_linear_model_is_least_squares() -> None:
    record = recorded(white())
    shapes = Linear().shapes(record)[:, 0]
    expected = np.linalg.lstsq(shapes, record.values[:, 0], rcond=None)[0]
    steps = run(problem(record))
    assert list(steps[-1].values.values()) == pytest.approx(expected, abs=1e-8)
    assert steps[-1].converged
    assert len(steps) <= 3
    assert steps[0].gain == pytest.approx(1.0, abs=1e-6), "the linearised problem is the problem"


def test_two_axes_are_weighed_by_their_full_covariance() -> None:
    """The relaxation in closed form: R from the residuals, generalised least squares with it, and again."""
    record = recorded(white(axes=2), "xz")
    shapes = Linear().shapes(record)
    genes = np.ones(3)
    for _ in range(30):
        left = record.values - shapes @ genes
        inverse = np.linalg.inv(left.T @ left / len(left))
        weighed = np.einsum("tcp,cd->tdp", shapes, inverse)
        normal = np.einsum("tdp,tdq->pq", weighed, shapes)
        genes = np.linalg.solve(normal, np.einsum("tdp,td->p", weighed, record.values))
    found = estimate(problem(record), HERE, {})
    assert list(found.values.values()) == pytest.approx(genes, abs=1e-5)
    left = record.values - shapes @ genes
    np.testing.assert_allclose(found.uncertainty.noise[0], left.T @ left / len(left), rtol=1e-3)
    n = len(left)
    cost = n + 0.5 * n * np.log(np.linalg.det(left.T @ left / n)) + n * np.log(2 * np.pi)
    assert found.uncertainty.cost == pytest.approx(cost, rel=1e-6), "Eq. 22"
    unweighed = np.linalg.lstsq(shapes.reshape(-1, 3), record.values.ravel(), rcond=None)[0]
    assert np.abs(unweighed - genes).max() > 1e-3, "the weights matter here"


def test_tracks_minimise_equation_22_with_a_variance_for_each_channel() -> None:
    """Against a simplex search of the likelihood written down here."""
    given = pendulum.problem(gravities=(9.81, 1.62))

    def cost(logs: Array) -> float:
        total = 0.0
        for r, record in enumerate(given.recordings):
            left = misfit(given, np.exp(logs)[None], r, residuals=True).residuals
            assert left is not None
            power, count = np.nansum(left[0] ** 2, axis=0), np.isfinite(record.values).sum(axis=0)
            total += float(0.5 * (count * np.log((power + 5 * power.mean() / count) / (count + 5))).sum())
        return total

    found = estimate(given, HERE, {"length": 0.6, "damping": 1.0})
    best = minimize(cost, np.log([0.3, 0.25]), method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-9})
    errors = uncertainty(Problem(given.model, given.recordings, given.free, given.base), HERE).standard_errors
    assert found.converged
    for name, value in zip(given.free, np.exp(best.x), strict=True):
        assert abs(found.values[name] - value) < 0.1 * errors[name], name
        assert abs(found.values[name] - pendulum.TRUE[name]) < 4 * errors[name], name


@pytest.mark.parametrize("corner", [(-4.0, -4.0, -4.0), (6.0, -4.0, 6.0)])
def test_every_corner_leads_to_the_same_place(corner: tuple[float, ...]) -> None:
    given = problem(recorded(white(axes=2), "xz"))
    middle = run(given)[-1].values
    found = run(given, dict(zip(TRUTH, corner, strict=True)))[-1]
    assert found.converged
    assert found.values == pytest.approx(middle, abs=1e-5)


def test_a_bound_holds_and_the_others_move_to_their_best_beside_it() -> None:
    """The best c is 1.5; the box ends at 1.3."""
    model, record = Linear(upper=1.3), recorded(white())
    shapes = model.shapes(record)[:, 0]
    expected = np.linalg.lstsq(shapes[:, :2], record.values[:, 0] - 1.3 * shapes[:, 2], rcond=None)[0]
    found = estimate(problem(record, model), HERE, {})
    assert found.values["c"] == pytest.approx(1.3, abs=1e-12)
    assert [found.values["a"], found.values["b"]] == pytest.approx(expected, abs=1e-6)
    assert found.converged
    assert any("c is at its upper bound 1.3" in remark for remark in found.remarks)


def test_a_cliff_beside_the_best_makes_differences_one_sided() -> None:
    """Everything above a = 1.205 fails, also the far neighbours; the best is 1.2."""
    record = recorded(white(seed=4) * 0.01)
    smooth, cliff = run(problem(record)), run(problem(record, Linear(fails_above=1.205)), {"a": 0.0})
    assert cliff[-1].values == pytest.approx(smooth[-1].values, abs=1e-4)
    assert any(step.reasons for step in cliff)
    assert cliff[-1].converged


def test_a_gene_without_neighbours_stays_and_the_others_are_fitted() -> None:
    found = estimate(problem(recorded(white()), Linear(fails_beside=1.0)), HERE, {"a": 1.0})
    assert found.values["a"] == 1.0
    assert found.uncertainty.standard_errors["a"] == np.inf
    assert found.uncertainty.standard_errors["b"] < 1
    assert "a has no known error: no neighbour of the best genome can be simulated" in found.remarks


def test_shorter_steps_are_tried_where_both_neighbours_fail() -> None:
    """A ledge narrower than the step: the shorter one stays on it, and the gene has its error."""
    record, ledge = recorded(white()), Linear(fails_beside=1.0, ledge=0.01)
    assert 10.0 * STEP > ledge.ledge > 10.0 * STEP * SHORTER
    wide, narrow = (uncertainty(problem(record, model), HERE) for model in (Linear(), ledge))
    assert narrow.standard_errors == pytest.approx(wide.standard_errors, rel=1e-6)


def test_a_start_that_cannot_be_simulated_is_refused() -> None:
    with pytest.raises(ValueError, match="cannot be simulated: broken"):
        run(problem(recorded(white()), Linear(fails_above=0.5)))


@pytest.mark.parametrize("cut", [0, 2, 4])
def test_resumed_equals_uninterrupted(cut: int) -> None:
    given, start = pendulum.problem(), {"length": 0.6, "damping": 1.0}
    whole = list(iterate(given, HERE, start))
    assert len(whole) > 5
    checkpoint = json.loads(json.dumps(whole[cut].checkpoint, allow_nan=False))
    assert list(iterate(given, HERE, {}, checkpoint)) == whole[cut + 1 :]


def test_a_finished_iteration_is_not_taken_up_again() -> None:
    given = problem(recorded(white()))
    assert list(iterate(given, HERE, {}, run(given)[-1].checkpoint)) == []


def test_a_checkpoint_without_an_initial_motion_goes_on_from_its_genes() -> None:
    given, start = pendulum.problem(), {"length": 0.6, "damping": 1.0}
    whole = list(iterate(given, HERE, start))
    old = {name: value for name, value in whole[0].checkpoint.items() if name != "motion"}
    assert list(iterate(given, HERE, {}, old)) == whole[1:]


def test_steps_are_judged_where_the_present_genome_fails_beside_them() -> None:
    class Stubborn(Linear):
        def observe(self, genomes: Array, recording: Recording) -> Observation:
            found = super().observe(genomes, recording)
            if len(genomes) == 1 or (genomes[-1] != 1.0).any():  # the start comes last, beside the steps from it
                return found
            found.channels[-1] = np.nan
            return Observation(found.channels, (*found.reasons[:-1], "broken"))

    record = recorded(white())
    expected = np.linalg.lstsq(Linear().shapes(record)[:, 0], record.values[:, 0], rcond=None)[0]
    steps = run(problem(record, Stubborn()))
    assert "broken" in steps[0].reasons
    assert list(steps[-1].values.values()) == pytest.approx(expected, abs=1e-8)


def test_noise_free_data_are_fitted_and_nothing_breaks() -> None:
    found = estimate(problem(recorded(np.zeros((300, 2)), "xz")), HERE, {"a": -3.0})
    assert found.values == pytest.approx(TRUTH, abs=1e-6)


def test_only_instants_with_all_fitted_axes_count() -> None:
    noise = white(axes=2)
    noise[10:60, 1] = np.nan
    record = recorded(noise, "xz")
    assert compared(record, ("x", "z")).sum() == 2 * 350
    assert compared(record, ("x",)).sum() == 400
    left = misfit(problem(record), np.ones((2, 3)), 0, residuals=True)
    assert left.samples == 700
    assert left.residuals is not None
    assert np.isnan(left.residuals[:, 10:60]).all()
    assert left.squares[0] == pytest.approx(np.nansum(left.residuals[0] ** 2))
    assert left.distance[0] == pytest.approx(np.sqrt(left.squares[0] / 700))
    with pytest.raises(ValueError, match="'z' is to be fitted, but recording 'balance' has x"):
        compared(recorded(white()), ("z",))
    assert estimate(problem(record), HERE, {}).converged


def test_axes_that_are_not_fitted_leave_no_trace() -> None:
    record = recorded(white(axes=2), "xz")
    both = Problem(Linear(), (record,), tuple(TRUTH), base_genome(Linear()))
    alone = recorded(record.values[:, :1] - Linear().shapes(record)[:, 0] @ np.array([[v] for v in TRUTH.values()]))
    assert run(both)[-1].values == pytest.approx(run(problem(alone))[-1].values, abs=1e-9)


def test_a_wing_converges_from_its_estimates(small: tuple[Dataset, Genome]) -> None:
    """Simulated motions carry a numerical error that differs between neighbours; it ends all the same, at the noise."""
    dataset, truth = small
    model, record = FlexibleWing(dataset.wing, "4"), dataset.recordings[0]
    names = ("E_r", "G_f", "D_E")
    given = Problem(model, (record,), names, base_genome(model, truth.as_dict()))
    start = base_genome(model).as_dict()
    steps = list(iterate(given, HERE, start))
    at_truth = misfit(given, np.array([[truth[name] for name in names]]), 0)
    assert steps[-1].converged
    assert steps[-1].fitness < at_truth.squares[0]
    assert sum(step.evaluations for step in steps) < 300
    known = uncertainty(Problem(model, (record,), names, given.base.replace(steps[-1].values)), HERE)
    for name in names:
        off = np.log(steps[-1].values[name] / truth[name])
        assert abs(off) < 4 * known.standing[name].standard_error, name


def test_an_initial_motion_is_settled_once_and_kept(
    small: tuple[Dataset, Genome], monkeypatch: pytest.MonkeyPatch
) -> None:
    dataset, truth = small
    settled: list[Array] = []

    def counted(subject: Subject, genome: Array, numerics: Numerics) -> Course | None:
        settled.append(genome)
        return settled_course(subject, genome, numerics)

    monkeypatch.setattr(flexible_wing, "settled_course", counted)
    names = ("E_r", "G_f")
    base = base_genome(FlexibleWing(dataset.wing, "4"), truth.as_dict() | {"E_r": 1.01 * truth["E_r"]})
    given = Problem(FlexibleWing(dataset.wing, "4"), (dataset.recordings[0],), names, base)
    assert len(run(given, base.as_dict())) > 1
    assert len(settled) == 1


def test_several_dampings_are_tried_at_once() -> None:
    """Far from the best, the whole step of Gauss-Newton leads too far; a damped one of the same batch does not."""

    class Bent(Linear):
        def observe(self, genomes: Array, recording: Recording) -> Observation:
            bent: Callable[[Array], Array] = np.tanh
            return super().observe(4 * bent(np.asarray(genomes) - np.array(list(TRUTH.values()))), recording)

    record = recorded(white() * 0.1)
    empty = Bent().observe(np.array([list(TRUTH.values())]), record).channels[0]
    given = problem(recorded(white() * 0.1), Bent())
    given = Problem(given.model, (Recording(**(record.__dict__ | {"values": empty + white() * 0.003})),), *_rest(given))
    steps = run(given, {"a": -0.6, "b": 2.5, "c": -0.2})
    assert steps[-1].converged
    assert steps[-1].values == pytest.approx(TRUTH, abs=0.02)
    assert all(step.gain > 0 for step in steps[:-1])


def _rest(given: Problem) -> tuple[tuple[str, ...], Genome, tuple[str, ...]]:
    return given.free, given.base, given.axes
