"""Fits the quasi-steady model with clap-and-peel to a simulated balance (force sensor) with known coefficients.

``python -m benchmarks.delfly [--json] [--no-estimators] [--seed N]``; with ``--json`` the last line is one JSON object.
``--example FOLDER`` only writes the example campaign. Conditions are the eight tests of Armanini et al. (2016).
"""

from __future__ import annotations

import argparse
import itertools
import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.common.machine import commit, cpu
from benchmarks.estimators import estimators
from benchmarks.physics.delfly_tables import closest_law_percent, fling_ends, lift_by_root_pitch, tables_law
from benchmarks.physics.missing_interval import missing_interval
from wingfit.calibration.estimates.likelihood import Estimate, estimate, iterate
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.forces.agreement import agreements
from wingfit.calibration.forces.global_model import at, fit_global
from wingfit.calibration.forces.result import Agreement, GlobalModel, LocalEstimate, Quantity
from wingfit.calibration.problem import Problem, base_genome
from wingfit.records import LowPass, Recording
from wingfit.records.dataset import STANDARD_GRAVITY
from wingfit.sim.filtering import low_passed
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.vehicle.motion import motion_genes
from wingfit.sim.vehicle.terms import chosen
from wingfit.sim.virtual_rigs.balance import (
    DRAG,
    TRIALS,
    Balance,
    Trial,
    blank_recording,
    delfly,
    record,
    true_beat,
    write_campaign,
)
from wingfit.workers import make_evaluator

Array = npt.NDArray[np.float64]

COEFFICIENTS = ("C_l", "C_r", "C_F")
CUTOFF, FINER_CUTOFF = 40.0, 67.0  # Hz (Armanini et al. 2016, 3.4)
FINER_TRIAL = 3  # test number four, as in Fig. 13 of Armanini et al. (2016)
INTERVAL = 1.6449  # half width of a 90 % interval in standard errors
REPETITIONS = 200
DRAWS = 20  # campaigns with other seeds
CORNER_TOLERANCE = 1e-3  # relative
SMALL = Balance(every=10, beats=40)  # for measurements that are repeated many times
# Without the errors that are constant throughout a recording, which residuals do not show: resonance, slow drift.
TOLD_BY_RESIDUALS = replace(SMALL, participation=0.0, drift=0.0)
LIFT_RMSE_PERCENT = (13, 13, 13, 15, 17, 18, 50, 32)  # Table 7 of Armanini et al. (2016)
LIFT_CORRELATION = (0.97, 0.97, 0.97, 0.96, 0.96, 0.94, 0.92, 0.85)


@dataclass(frozen=True)
class Fitted:
    """A model fitted to one recording.

    ``problem``: its base genome is the estimate; ``agreement``: correlation and error of each force; ``misfit_range``:
    interval of the beat (start, end; fractions) in which the model misses physics, or None.
    """

    trial: Trial
    recording: Recording
    problem: Problem
    estimate: Estimate
    agreement: dict[Quantity, Agreement]
    misfit_range: tuple[float, float] | None

    @property
    def errors(self) -> dict[str, float]:
        """Relative error (per cent) of each coefficient with a known true value."""
        true = self.trial.coefficients
        return {name: 100 * (value / true[name] - 1) for name, value in self.estimate.values.items() if name in true}

    @property
    def local(self) -> LocalEstimate:
        """The estimate and its standard errors in the form to which the global model is fitted."""
        found, name = self.estimate, self.recording.name
        bounds = dict(zip(found.free, np.sqrt(np.diag(found.uncertainty.covariance)).tolist(), strict=True))
        return LocalEstimate(name, (name,), found.values, bounds, (), (), found.uncertainty.cost, True, ())


def problem_of(model: BladeElementWing, recording: Recording) -> Problem:
    """Return the problem of fitting lift coefficients to the force along x, drag fixed (Armanini et al. 2016)."""
    drag = {name: value for name, value in DRAG.items() if name in {gene.name for gene in model.genes}}
    return Problem(model, (recording,), model.searched, base_genome(model, drag), ("x",))


def fit(model: BladeElementWing, recording: Recording, trial: Trial, evaluator: Evaluator) -> Fitted:
    """Estimate the coefficients, starting from their nominal values, and compare the forces with the recorded ones."""
    problem = problem_of(model, recording)
    found = estimate(problem, evaluator, {})
    best = replace(problem, base=problem.base.replace(found.values))
    forces = model.observe([best.base.values], recording).channels[0]
    agreement = {a.quantity: a for a in agreements(recording, forces, "local")}
    return Fitted(trial, recording, best, found, agreement, missing_interval(best, evaluator))


def corners(model: BladeElementWing, fitted: list[Fitted], evaluator: Evaluator) -> float:
    """Return the percentage of fits from all corners of the search box, in all tests, that end at the estimate."""
    good, total = 0, 0
    for one in fitted:
        problem = problem_of(model, one.recording)
        genes = [gene for gene in model.genes if gene.name in problem.free]
        for corner in itertools.product(*((gene.lower, gene.upper) for gene in genes)):
            *_, last = iterate(problem, evaluator, dict(zip(problem.free, corner, strict=True)))
            off = [abs(last.values[name] / value - 1) for name, value in one.estimate.values.items()]
            good, total = good + (last.converged and max(off) < CORNER_TOLERANCE), total + 1
    return 100 * good / total


def coverage(
    model: BladeElementWing, beats: list[Array], balance: Balance, repetitions: int, seed: int, evaluator: Evaluator
) -> dict[str, float]:
    """Return the percentage of 90 % intervals, over fits with other noise, that contain the truth, by coefficient."""
    held = dict.fromkeys(COEFFICIENTS, 0)
    for k in range(repetitions):
        trial, beat = TRIALS[k % len(TRIALS)], beats[k % len(TRIALS)]
        raw = record(beat, trial, balance, np.random.default_rng([seed, 4, k]))
        found = estimate(problem_of(model, low_passed(raw, LowPass(CUTOFF))), evaluator, {})
        for name, error in zip(found.free, np.sqrt(np.diag(found.uncertainty.covariance)), strict=True):
            held[name] += bool(abs(found.values[name] - trial.coefficients[name]) <= INTERVAL * error)
    return {name: 100 * count / repetitions for name, count in held.items()}


def luck(model: BladeElementWing, beats: list[Array], seed: int, evaluator: Evaluator) -> dict[str, float]:
    """Return median and maximum, over random seeds of the noise, of the largest error (per cent) of any coefficient."""
    largest = []
    for draw in range(DRAWS):
        errors = []
        for k, (trial, beat) in enumerate(zip(TRIALS, beats, strict=True)):
            raw = record(beat, trial, replace(Balance(), every=10), np.random.default_rng([seed, 6, draw, k]))
            *_, last = iterate(problem_of(model, low_passed(raw, LowPass(CUTOFF))), evaluator, {})
            errors += [100 * abs(last.values[name] / true - 1) for name, true in trial.coefficients.items()]
        largest.append(max(errors))
    return {"median": float(np.median(largest)), "most": max(largest)}


def systematic(model: BladeElementWing, evaluator: Evaluator) -> dict[str, float]:
    """Return the largest error (per cent) of any coefficient in any test, by kind of systematic measurement error."""
    still = Balance(every=10, beats=10, sensor=0.0, participation=0.0, rattle=0.0, drift=0.0, scatter=0.0, timing=0.0)
    largest = dict.fromkeys(
        ("finer_truth", "resonance", "zero_off_by_1_mn", "phase_off_by_a_thousandth_of_a_beat"), 0.0
    )
    for trial in TRIALS:
        rng, beat = np.random.default_rng(0), true_beat(model.vehicle, trial)
        plain = record(beat, trial, still, rng)
        shift = 0.001 / trial.condition.flap_frequency
        spoilt = (
            plain,
            record(beat, trial, replace(still, participation=Balance().participation), rng),
            replace(plain, values=plain.values + 1e-3),
            replace(plain, times=plain.times + shift),
        )
        for name, raw in zip(largest, spoilt, strict=True):
            problem = problem_of(model, low_passed(raw, LowPass(CUTOFF)))
            *_, last = iterate(problem, evaluator, {})
            errors = [abs(last.values[n] / true - 1) for n, true in trial.coefficients.items()]
            largest[name] = max(largest[name], 100 * max(errors))
    return largest


def milliseconds(model: BladeElementWing, batch: int = 64, rounds: int = 7) -> float:
    """Return the processor time (ms) of one individual in a batch of different motions; best of ``rounds``."""
    rng, best = np.random.default_rng(0), np.inf
    nominal = np.array([gene.nominal for gene in model.genes])
    width = np.array([gene.upper - gene.lower for gene in model.genes])
    names = {gene.name for gene in motion_genes(model.vehicle.motion)}
    inside = np.array([gene.name in names for gene in model.genes])
    blank = blank_recording(TRIALS[FINER_TRIAL].condition)
    for _ in range(rounds):
        genomes = nominal + 0.1 * width * rng.uniform(-1, 1, (batch, len(nominal))) * inside
        start = time.process_time()
        model.beat(genomes, blank)
        best = min(best, time.process_time() - start)
    return 1e3 * best / batch


def global_errors(law: GlobalModel) -> dict[str, float]:
    """Return the largest relative difference (per cent) of the global model from local estimates, by coefficient."""
    return {gene.name: 100 * gene.largest_error for gene in law.genes}


def lift_by_law(fitted: list[Fitted], law: GlobalModel) -> float:
    """Return the RMS error (per cent) of lift with the global model ``law``, mean over the tests."""
    found = []
    for one in fitted:
        genome = one.problem.base.replace(at(law, one.trial.condition).values)
        forces = one.problem.model.observe(np.array([genome.values]), one.recording).channels[0]
        found += [a.rmse_percent for a in agreements(one.recording, forces, "global") if a.quantity == "lift"]
    return float(np.mean(found))


def mean_lift(fitted: list[Fitted]) -> tuple[float, float]:
    """Return correlation and RMS error (per cent) of lift, means over the tests."""
    lift = [one.agreement["lift"] for one in fitted]
    return float(np.mean([a.correlation for a in lift])), float(np.mean([a.rmse_percent for a in lift]))


def widest(ranges: list[tuple[float, float] | None]) -> list[float] | None:
    """Return the smallest interval that contains all ``ranges``; None if one of them is None."""
    known = [one for one in ranges if one is not None]
    return [min(r[0] for r in known), max(r[1] for r in known)] if len(known) == len(ranges) else None


def fits(
    seed: int, models: Mapping[str, BladeElementWing], evaluator: Evaluator
) -> tuple[dict[str, list[Fitted]], dict[str, Fitted]]:
    """Fit each model to all tests, low-passed at CUTOFF, and to one at FINER_CUTOFF; return both sets, by model."""
    vehicle = delfly()
    found: dict[str, list[Fitted]] = {name: [] for name in models}
    finer: dict[str, Fitted] = {}
    for k, trial in enumerate(TRIALS):
        raw = record(true_beat(vehicle, trial), trial, Balance(), np.random.default_rng([seed, 3, k]))
        coarse = low_passed(raw, LowPass(CUTOFF))
        for name, model in models.items():
            found[name].append(fit(model, coarse, trial, evaluator))
            if k == FINER_TRIAL:
                finer[name] = fit(model, low_passed(raw, LowPass(FINER_CUTOFF)), trial, evaluator)
    return found, finer


def agreement_figures(fitted: Mapping[str, list[Fitted]], finer: Mapping[str, Fitted]) -> dict[str, Any]:
    """Return, for the report, errors of coefficients, where in the beat models miss physics, agreement of lift."""
    figures: dict[str, Any] = {
        "coefficient_error_percent": max(abs(e) for one in fitted["proposed"] for e in one.errors.values()),
        "misfit_tstar_range": widest([one.misfit_range for one in fitted["without_fling"]]),
        "misfit_tstar_range_berman_wang": widest([one.misfit_range for one in fitted["berman_wang"]]),
        "misfit_located_with_fling": sum(one.misfit_range is not None for one in fitted["proposed"]),
    }
    for name, suffix in (("proposed", ""), ("without_fling", "_without_fling"), ("berman_wang", "_berman_wang")):
        figures[f"lift_correlation{suffix}"], figures[f"lift_rmse_percent{suffix}"] = mean_lift(fitted[name])
    figures["at_67_hz"] = {
        name: {
            "lift_correlation": one.agreement["lift"].correlation,
            "lift_rmse_percent": one.agreement["lift"].rmse_percent,
            "coefficients": one.estimate.values,
            "misfit_tstar_range": one.misfit_range,
        }
        for name, one in finer.items()
    }
    return figures


def global_figures(fitted: list[Fitted]) -> dict[str, Any]:
    """Return, for the report, differences of the global model from local estimates and from Table 8."""
    local, conditions = [one.local for one in fitted], [one.trial.condition for one in fitted]
    law, plain = fit_global(local, conditions), fit_global(local, conditions, weighted=False)
    return {
        "global_error_percent": max(global_errors(law).values()),
        "global_error_percent_by_coefficient": global_errors(law),
        "global_error_percent_plain": global_errors(plain),
        "global_error_percent_of_printed_table": global_errors(tables_law()),
        "closest_affine_law_percent_of_printed_table": {name: closest_law_percent(name) for name in ("C_l", "C_F")},
        "global_scatter": {gene.name: gene.scatter for gene in law.genes},
        "global_left_out_error_percent": {
            gene.name: None if gene.left_out_error is None else 100 * gene.left_out_error for gene in law.genes
        },
        "lift_rmse_percent_global": lift_by_law(fitted, law),
    }


def repeated_figures(model: BladeElementWing, repetitions: int, seed: int, evaluator: Evaluator) -> dict[str, Any]:
    """Return, for the report, coverage of intervals, convergence from corners, errors with other noise."""
    beats = [true_beat(model.vehicle, trial) for trial in TRIALS]
    covered = coverage(model, beats, TOLD_BY_RESIDUALS, repetitions, seed, evaluator)
    starts = [
        fit(
            model,
            low_passed(record(beat, trial, SMALL, np.random.default_rng([seed, 5])), LowPass(CUTOFF)),
            trial,
            evaluator,
        )
        for trial, beat in zip(TRIALS, beats, strict=True)
    ]
    return {
        "interval_coverage_percent": float(np.mean(list(covered.values()))),
        "interval_coverage_percent_by_coefficient": covered,
        "interval_coverage_percent_with_systematic_errors": coverage(model, beats, SMALL, repetitions, seed, evaluator),
        "converged_from_corners_percent": corners(model, starts, evaluator),
        "coefficient_error_percent_of_other_draws": luck(model, beats, seed, evaluator),
        "systematic_error_percent": systematic(model, evaluator),
    }


def rows(fitted: Mapping[str, list[Fitted]]) -> list[dict[str, Any]]:
    """Return one row per test: estimated and true coefficients, agreement of lift and drag, results without fling."""
    return [
        {
            "condition": one.trial.name,
            "true": one.trial.coefficients,
            "found": one.estimate.values,
            "error_percent": one.errors,
            "standard_error_percent": {
                n: 100 * e / abs(one.estimate.values[n]) for n, e in one.local.standard_errors.items()
            },
            "largest_correlation": float(
                np.abs(one.estimate.uncertainty.correlation - np.eye(len(COEFFICIENTS))).max()
            ),
            "lift_rmse_n": one.agreement["lift"].rmse,
            "lift_rmse_percent": one.agreement["lift"].rmse_percent,
            "lift_correlation": one.agreement["lift"].correlation,
            "drag_correlation": one.agreement["drag"].correlation,
            "mean_lift_n": one.agreement["lift"].mean_recorded,
            "weight_n": STANDARD_GRAVITY * one.trial.mass,
            "without_fling": {
                "found": poorer.estimate.values,
                "lift_rmse_n": poorer.agreement["lift"].rmse,
                "lift_rmse_percent": poorer.agreement["lift"].rmse_percent,
                "lift_correlation": poorer.agreement["lift"].correlation,
                "mean_lift_modelled_n": poorer.agreement["lift"].mean_modelled,
                "misfit_tstar_range": poorer.misfit_range,
            },
        }
        for one, poorer in zip(fitted["proposed"], fitted["without_fling"], strict=True)
    ]


def measure(seed: int, repetitions: int, evaluator: Evaluator) -> dict[str, Any]:
    """Measure and return all figures of the benchmark except those of the estimators."""
    start, vehicle = time.perf_counter(), delfly()
    models = {
        "proposed": BladeElementWing(vehicle),
        "without_fling": BladeElementWing(vehicle, chosen("proposed", ("clap_and_peel",))),
        "berman_wang": BladeElementWing(vehicle, chosen("berman_wang")),
    }
    fitted, finer = fits(seed, models, evaluator)
    figures = agreement_figures(fitted, finer) | global_figures(fitted["proposed"])
    figures |= repeated_figures(models["proposed"], repetitions, seed, evaluator)
    figures |= {"mean_lift_n_by_root_pitch": lift_by_root_pitch(), "fling_ends_tstar": fling_ends(models["proposed"])}
    figures |= {"ms_per_individual": milliseconds(models["proposed"]), "conditions": rows(fitted)}
    return figures | {"seed": seed, "seconds": time.perf_counter() - start, "cpu": cpu(), "commit": commit()}


def table(conditions: list[dict[str, Any]]) -> str:
    """Return ``conditions`` (:func:`rows`) as text, with the figures of Armanini et al. (2016) in brackets."""
    head = (
        "condition  C_l est. (true)    C_r est. (true)    C_F est. (true)    lift: RMSE %    correlation   "
        "without fling: RMSE %  correlation  misfit at t*"
    )
    lines = [head]
    for k, row in enumerate(conditions):
        coefficients = "   ".join(f"{row['found'][n]:6.3f} ({row['true'][n]:.2f})  " for n in COEFFICIENTS)
        poorer = row["without_fling"]
        place = poorer["misfit_tstar_range"]
        where = "none" if place is None else f"{place[0]:.2f} to {place[1]:.2f}"
        lines.append(
            f"{row['condition']:9}  {coefficients}  {row['lift_rmse_percent']:5.1f} ({LIFT_RMSE_PERCENT[k]})     "
            f"{row['lift_correlation']:.3f} ({LIFT_CORRELATION[k]:.2f})  {poorer['lift_rmse_percent']:12.1f}  "
            f"{poorer['lift_correlation']:18.3f}      {where}"
        )
    return "\n".join(lines)


def main() -> None:
    """Parse the command line, measure, and print the figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.delfly", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")
    parser.add_argument("--no-estimators", action="store_true", help="do not compare search methods")
    parser.add_argument(
        "--repetitions", type=int, default=REPETITIONS, help="number of noise realisations for the intervals"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--example", type=Path, help="only write the example campaign into this folder")
    arguments = parser.parse_args()
    if arguments.example:
        print(f"truth: {write_campaign(arguments.example, arguments.seed)}")
        return
    evaluator = make_evaluator("in_process")
    try:
        figures = measure(arguments.seed, arguments.repetitions, evaluator)
    finally:
        evaluator.close()
    if not arguments.no_estimators:
        figures["estimators"] = estimators()
    print(table(figures["conditions"]))
    for key, value in figures.items():
        if key != "conditions":
            print(f"{key}: {value}")
    if arguments.json:
        print(json.dumps(figures))


if __name__ == "__main__":
    main()
