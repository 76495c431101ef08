"""The DelFly study: data of wings that clap and peel, diagnosed with a model without wing-wing interaction.

The model is after Berman and Wang (2007). Conditions are those of Armanini et al. (2016), Table 4, with the
coefficients estimated there for each test (Table 8).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.concealed.benches.vehicle import VehicleBench
from benchmarks.concealed.trials import Build
from benchmarks.delfly import LIFT_CORRELATION, fit
from benchmarks.proof.story import Claim, Story, diagnosed, families, leader, nominal_misfit, over_floor, saved
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.forces.agreement import agreements
from wingfit.calibration.preparation import as_fitted
from wingfit.calibration.problem import base_genome
from wingfit.calibration.search import calibrate
from wingfit.calibration.spec import CalibrationSpec, vehicle_model
from wingfit.diagnosis.finding import Finding, Interval
from wingfit.records import Dataset
from wingfit.sim.virtual_rigs.balance import DRAG, HELD_OUT, TRIALS, Trial
from wingfit.workers import make_evaluator

BASELINE = "berman_wang"
FLING = "clap_and_peel"
ALSO_RIGHT = ("varying_coefficients",)
"""Effects that are correct if named in addition to FLING: the true coefficients differ from test to test."""
AXES = ("x", "z")
FLING_ENDS = 0.4  # t*
AS_IN_TABLE_7 = float(np.mean(LIFT_CORRELATION))


@dataclass(frozen=True)
class Lift:
    """Correlation of modelled with recorded lift in one test (``name``), before and after the diagnosis."""

    name: str
    held_out: bool
    before: float
    after: float


def campaign(
    seed: int,
    trials: tuple[Trial, ...] = TRIALS,
    held_out: tuple[str, ...] = HELD_OUT,
    without: tuple[str, ...] = (),
) -> Dataset:
    """Dataset of simulated balance recordings, one per test in ``trials``, with that test's coefficients.

    The plant omits the force terms ``without``. The same seed gives bit-identical data.
    """
    bench = VehicleBench(Build("vehicle", without=without, body="delfly"))
    balance = bench.quality(np.random.default_rng([seed, 2]))
    recordings = []
    for number, trial in enumerate(trials):
        rng = np.random.default_rng([seed, 3, number])
        made = bench.recording(trial.condition, DRAG | trial.coefficients, {}, balance, rng)
        recordings.append(replace(made.recording, name=trial.name, mass=trial.mass))
    return Dataset("delfly", bench.rig, tuple(recordings), held_out)


def located(
    dataset: Dataset, evaluator: Evaluator, trials: tuple[Trial, ...] = TRIALS
) -> dict[str, tuple[float, float] | None]:
    """Interval of the beat (t*) in which the nominal model misses physics, by test; None if it is not significant.

    The model is fitted to each test separately, as by Armanini et al. (2016).
    """
    spec, model = CalibrationSpec(preset=BASELINE), vehicle_model(dataset, CalibrationSpec(preset=BASELINE))
    tests = {trial.name: trial for trial in trials}
    return {
        one.name: fit(model, as_fitted(spec, one), tests[one.name], evaluator).misfit_range
        for one in dataset.recordings
        if one.name not in dataset.held_out
    }


def lifts(dataset: Dataset, finding: Finding, evaluator: Evaluator) -> tuple[Lift, ...]:
    """Correlation of modelled with recorded lift in each test, for the nominal and for the diagnosed model.

    The nominal model is calibrated here on all fitted tests together; the diagnosed one has the genes of ``finding``.
    """
    spec = CalibrationSpec(preset=BASELINE, mode="joint", axes=AXES)
    *_, last = calibrate(spec, dataset, evaluator)
    before = _lift(dataset, spec, last.genome)
    genes = {gene.name: gene.value.value for gene in finding.genes}
    effects = tuple(dict.fromkeys(name.partition(".")[0] for name in genes if "." in name))
    after = _lift(dataset, replace(spec, effects=effects), genes)
    names = (one.name for one in dataset.recordings)
    return tuple(Lift(name, name in dataset.held_out, before[name], after[name]) for name in names)


def _lift(dataset: Dataset, spec: CalibrationSpec, values: Mapping[str, float]) -> dict[str, float]:
    """Correlation of modelled with recorded lift by recording, for the model of ``spec`` with genes ``values``."""
    model = vehicle_model(dataset, spec)
    genome, found = base_genome(model, values), {}
    for recording in dataset.recordings:
        filtered = as_fitted(spec, recording)
        forces = model.observe([genome.values], filtered).channels[0]
        found[recording.name] = next(
            a.correlation for a in agreements(filtered, forces, "joint") if a.quantity == "lift"
        )
    return found


def play(folder: Path, seed: int, workers: int) -> Story:
    """Run the study: simulate recordings, diagnose them, locate the misfit; write dataset and report to ``folder``."""
    dataset = campaign(seed)
    finding, page = diagnosed(saved(dataset, folder), {"preset": BASELINE}, workers)
    evaluator = make_evaluator("in_process")
    try:
        return story_of(finding, located(dataset, evaluator), lifts(dataset, finding, evaluator), page)
    finally:
        evaluator.close()


def story_of(
    finding: Finding, places: Mapping[str, tuple[float, float] | None], lift: tuple[Lift, ...], page: Path
) -> Story:
    """Figures, text and claims of the study.

    ``places``: interval of the misfit by test, from :func:`located`; ``page``: path of the report.
    """
    best, floors = leader(finding), over_floor(finding)
    found = [place for place in places.values() if place is not None]
    widest = (min(p[0] for p in found), max(p[1] for p in found)) if found else None
    means = {
        f"lift_correlation_{when}{group}": _mean(lift, when, held_out)
        for group, held_out in (("_fitted", False), ("_heldout", True))
        for when in ("before", "after")
    }
    before, after = (float(np.mean([getattr(one, when) for one in lift])) for when in ("before", "after"))
    where = finding.where
    phase = None if where is None or where.phase is None else _ends(where.phase)
    figures: dict[str, Any] = {
        "verdict": finding.verdict,
        "probability": finding.probabilities[finding.verdict],
        "named": list(finding.named),
        "family": list(families(finding)),
        "hidden": [FLING],
        "genes": [
            {"gene": g.name, "found": g.value.value, "low": g.value.low, "high": g.value.high} for g in finding.genes
        ],
        "misfit_tstar_range": widest,
        "misfit_tstar_by_test": dict(places),
        "misfit_words": None if where is None else where.words,
        "misfit_tstar": phase,
        "lift_correlation_before": before,
        "lift_correlation_after": after,
        "lift_correlation_table_7": AS_IN_TABLE_7,
        **means,
        "tests": [
            {"test": one.name, "held_out": one.held_out, "before": one.before, "after": one.after, "table_7": source}
            for one, source in zip(lift, _table_7(lift), strict=True)
        ],
        "refitted_rms_mn": 1e3 * nominal_misfit(finding),
        "found_rms_mn": 1e3 * best.misfit,
        "noise_rms_mn": 1e3 * finding.floors.noise,
        **floors,
        "diagnosis_seconds": finding.seconds,
    }
    claims = (
        Claim("the diagnosis locates the misfit at t* < 0.4", phase is not None and phase[1] < FLING_ENDS),
        Claim(
            "so does the nominal model fitted to each test separately",
            bool(places) and all(place is not None and place[1] < FLING_ENDS for place in places.values()),
        ),
        Claim("the diagnosis names wing-wing interaction", FLING in finding.named),
        Claim("it names no effect that was not hidden", set(finding.named) <= {FLING, *ALSO_RIGHT}),
        Claim(f"lift correlation rises to Table 7's mean ({AS_IN_TABLE_7:.2f})", before < AS_IN_TABLE_7 <= after),
        Claim("it also rises in every held-out test", all(one.after > one.before for one in lift if one.held_out)),
    )
    return Story(figures, _lines(finding, widest, lift, before, after), claims, page)


def _ends(interval: Interval) -> tuple[float, float]:
    """Lower and upper bound of a phase interval (beats); a missing bound is set one beat from the value."""
    low, high = interval.low, interval.high
    return interval.value - 1.0 if low is None else low, interval.value + 1.0 if high is None else high


def _mean(lift: tuple[Lift, ...], when: str, held_out: bool) -> float | None:
    values = [getattr(one, when) for one in lift if one.held_out is held_out]
    return float(np.mean(values)) if values else None


def _table_7(lift: tuple[Lift, ...]) -> list[float]:
    known = dict(zip((trial.name for trial in TRIALS), LIFT_CORRELATION, strict=True))
    return [known[one.name] for one in lift]


def _lines(
    finding: Finding, widest: tuple[float, float] | None, lift: tuple[Lift, ...], before: float, after: float
) -> tuple[str, ...]:
    where = "(not located)" if widest is None else f"at t* {widest[0]:.2f} to {widest[1]:.2f}"
    rows = (
        f"  {one.name}{' (held out)' if one.held_out else '':11} {one.before:7.3f} {one.after:7.3f} {source:12.2f}"
        for one, source in zip(lift, _table_7(lift), strict=True)
    )
    return (
        f"the model after Berman and Wang, fitted to each test, misfits {where}",
        f"diagnosis, {finding.seconds:.0f} s: {finding.verdict}: {', '.join(finding.named) or 'nothing'}",
        finding.summary,
        "  correlation of lift   before   after   in the source",
        *rows,
        f"  {'mean':17} {before:7.3f} {after:7.3f} {AS_IN_TABLE_7:12.2f}",
    )
