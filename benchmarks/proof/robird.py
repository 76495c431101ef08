"""The Robird study: data of a wing whose drive axis and linkage differ from their description.

van der Grinten's search stalled at a mean distance of about 2 cm between simulated and recorded markers, and he named
the place of the drive's axis as a likely cause. In the plant (the simulator that makes the data) the axis is displaced
and the linkage has a longer frame; the diagnosed model contains neither.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.concealed.benches.bench import record_all
from benchmarks.concealed.benches.wing import WingBench
from benchmarks.concealed.plant.law import Concealed
from benchmarks.concealed.trials import LAGS, THICK_PA, THIN_PA, Build, chamber, name_of, tunnel
from benchmarks.proof.story import (
    Claim,
    Story,
    beside_truth,
    diagnosed,
    families,
    leader,
    nominal_misfit,
    over_floor,
    saved,
)
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import base_genome
from wingfit.calibration.result import Result, judge
from wingfit.calibration.search import calibrate
from wingfit.calibration.spec import CalibrationSpec, wing_model
from wingfit.cli.base.output import progress
from wingfit.diagnosis.finding import Finding
from wingfit.records import Condition, Dataset, Recording
from wingfit.workers import make_evaluator

DIVISION = "11"
HIDDEN: Concealed = {
    "hinge_offset": {"strength": 0.055, "direction": -0.8},  # m, rad from y to z
    "drive_harmonics": {"strength": 0.06},  # relative increase of the linkage's frame
}
"""Hidden effects of the plant; together they displace the markers by 2 cm on average, as in the thesis."""
FITTED: tuple[Condition, ...] = (
    chamber(THIN_PA, LAGS[0], 2.0),
    chamber(THIN_PA, LAGS[1], 3.5),
    chamber(THICK_PA, LAGS[2], 3.0),
    tunnel(LAGS[1], 3.0, 3.5),
    tunnel(LAGS[0], 4.0, 7.5),
)
HELD_OUT: tuple[Condition, ...] = (chamber(THIN_PA, LAGS[2], 2.5), tunnel(LAGS[2], 2.5, 5.0))
"""Conditions used for validation only: combinations of frequency, lag and airspeed that no fitted recording has."""

SEARCH_S = 240.0  # time limit of the thesis's search, if it has not stalled before
RECENT, LITTLE = (
    10,
    0.02,
)  # a search has stalled if the misfit falls by less than LITTLE (relative) in RECENT generations
CENTIMETRES = 0.01  # m: smallest mean distance that counts as a stall "at centimetres"
AT_FLOOR = 1.15  # ratio to the floor below which a held-out misfit counts as at the floor


@dataclass(frozen=True)
class Campaign:
    """A simulated dataset with the true values of its parameters.

    ``genome``: true genes of the nominal model; ``truth``: values of the genes with which the effects of the diagnosis
    represent the hidden effects.
    """

    dataset: Dataset
    genome: Mapping[str, float]
    truth: Mapping[str, float]

    def left_by_truth(self) -> float:
        """RMS misfit (m) to the held-out recordings of the model with the effects of the diagnosis at the true values.

        It exceeds the noise, because the effect of the diagnosis changes three harmonics of the drive only, whereas
        that of the plant changes all.
        """
        spec = CalibrationSpec(division=DIVISION, effects=tuple({name.partition(".")[0] for name in self.truth}))
        model = wing_model(self.dataset, spec)
        values = base_genome(model, {**self.genome, **self.truth}).values
        held_out = [one for one in self.dataset.recordings if one.name in self.dataset.held_out]
        left = [(model.observe([values], one).channels[0] - one.values).ravel() for one in held_out]
        return float(np.sqrt(np.nanmean(np.concatenate(left) ** 2)))


@dataclass(frozen=True)
class Stall:
    """Result of van der Grinten's genetic search, which ended by itself (``stalled``) or was stopped at the time limit.

    ``gain`` is the relative decrease of the best mean distance over the last RECENT generations of the last stage;
    ``seconds``: duration of search and final assessment.
    """

    result: Result
    gain: float
    generations: int
    evaluations: int
    seconds: float
    stalled: bool


def campaign(seed: int, hidden: Concealed = HIDDEN) -> Campaign:
    """Simulate recordings of the plant with random parameters under all conditions, reproducibly from ``seed``."""
    return filmed("robird", WingBench(Build("wing", DIVISION, DIVISION)), seed, hidden)


def filmed(name: str, bench: WingBench, seed: int, hidden: Concealed) -> Campaign:
    """Film the wing of ``bench`` with random parameters and the effects ``hidden``; ``name``: of the dataset."""
    genome = bench.genome(np.random.default_rng([seed, 1]))
    recordings, conditions = list[Recording](), (*FITTED, *HELD_OUT)
    with progress(f"{name}: filming the plant") as tell:
        for recording in record_all(bench, conditions, genome, hidden, seed):
            recordings.append(recording)
            tell(len(recordings) / len(conditions), None, recording.name)
    truth = {gene: value for law, one in hidden.items() for gene, value in bench.laws[law].values(one).items()}
    dataset = Dataset(name, bench.rig, tuple(recordings), tuple(name_of(condition) for condition in HELD_OUT))
    return Campaign(dataset, genome, truth)


def stall(
    dataset: Dataset, evaluator: Evaluator, seconds: float = SEARCH_S, spec: CalibrationSpec | None = None
) -> Stall:
    """Calibrate the nominal model by the genetic search of van der Grinten's thesis until it stalls.

    Population 50, structural genes in vacuum first; ``seconds``: time limit.
    """
    spec, began = spec or CalibrationSpec(division=DIVISION), time.monotonic()
    last, stalled, stages, best = None, True, list[str](), list[float]()
    with progress(f"{dataset.name}: the thesis's search") as tell:
        for last in calibrate(spec, dataset, evaluator):
            spent = time.monotonic() - began
            stages.append(last.stage)
            best.append(last.distance)
            note = f"{last.stage}, generation {last.index}, best {1e3 * last.distance:.1f} mm"
            tell(min(max(last.progress, spent / seconds if seconds else 1.0), 1.0), None, note)
            if spent > seconds and last.progress < 1.0:
                stalled = False
                break
    if last is None:
        raise RuntimeError("the search had no generation")
    result = judge(spec, dataset, evaluator, last.genome)
    return Stall(result, gained(stages, best), len(best), last.evaluations, time.monotonic() - began, stalled)


def gained(stages: Sequence[str], best: Sequence[float]) -> float:
    """Relative decrease of ``best`` over the last RECENT generations of the last stage.

    ``stages`` and ``best`` hold the stage and the best mean distance (m) of each generation.
    """
    recent = [one for stage, one in zip(stages, best, strict=True) if stage == stages[-1]][-RECENT - 1 :]
    return 1.0 - recent[-1] / recent[0]


def play(folder: Path, seed: int, workers: int, seconds: float = SEARCH_S) -> Story:
    """Run the study: simulate recordings, search as in the thesis, diagnose; write dataset and report to ``folder``.

    ``seconds``: time limit of the search.
    """
    made = campaign(seed)
    path = saved(made.dataset, folder)
    evaluator = make_evaluator("processes", workers)
    try:
        search = stall(made.dataset, evaluator, seconds)
    finally:
        evaluator.close()
    finding, page = diagnosed(path, {"division": DIVISION}, workers)
    return story_of(made, search, finding, page)


def story_of(made: Campaign, search: Stall, finding: Finding, page: Path) -> Story:
    """Figures, text and claims of the study from campaign, search and diagnosis; ``page``: path of the report."""
    best, kinds, floors = leader(finding), families(finding), over_floor(finding)
    rows = beside_truth({gene.name: gene for gene in finding.genes}, made.truth)
    after, truth = floors["heldout_over_floor"], made.left_by_truth()
    left = None if finding.proof is None else finding.proof.after.value * finding.proof.floor
    figures: dict[str, Any] = {
        "nominal_mm": 1e3 * search.result.before,
        "stall_mm": 1e3 * search.result.after,
        "stall_heldout_mm": _mm(search.result.held_out_after),
        "stalled": search.stalled,
        "last_gain_percent": 100 * search.gain,
        "generations": search.generations,
        "evaluations": search.evaluations,
        "search_seconds": search.seconds,
        "verdict": finding.verdict,
        "probability": finding.probabilities[finding.verdict],
        "named": list(finding.named),
        "family": list(kinds),
        "hidden": sorted(HIDDEN),
        "genes": rows,
        "refitted_rms_mm": 1e3 * nominal_misfit(finding),
        "found_rms_mm": 1e3 * best.misfit,
        "noise_rms_mm": 1e3 * finding.floors.noise,
        **floors,
        "truth_heldout_rms_mm": 1e3 * made.left_by_truth(),
        "found_heldout_rms_mm": None
        if finding.proof is None
        else 1e3 * finding.proof.after.value * finding.proof.floor,
        "diagnosis_seconds": finding.seconds,
    }
    claims = (
        Claim(
            "the thesis's search stalls at centimetres",
            search.result.after >= CENTIMETRES and (search.stalled or search.gain < LITTLE),
        ),
        Claim("the diagnosis finds the cause in the actuation", bool(kinds) and set(kinds) == {"actuation"}),
        Claim("it names the displaced axis and the drive profile", set(finding.named) == set(HIDDEN)),
        Claim("the held-out misfit falls to the floor", after is not None and after <= AT_FLOOR),
        Claim("it falls to the misfit of the true values", left is not None and left <= AT_FLOOR * truth),
    )
    return Story(figures, _lines(search, finding, rows, left, truth), claims, page)


def _lines(
    search: Stall, finding: Finding, rows: list[dict[str, Any]], left: float | None, truth: float
) -> tuple[str, ...]:
    result = search.result
    how = "stalls" if search.stalled else f"is stopped (last {RECENT} generations: {100 * search.gain:.1f} % better)"
    return (
        f"the thesis's search begins at {1e3 * result.before:.1f} mm of mean distance and {how} at "
        f"{1e3 * result.after:.1f} mm ({search.generations} generations of 50, {search.seconds:.0f} s)",
        f"diagnosis, {finding.seconds:.0f} s: {finding.verdict}: {', '.join(finding.named) or 'nothing'}",
        finding.summary,
        *(_row(row) for row in rows),
        f"  held-out RMS: {_millimetres(left)} with the diagnosed model, {_millimetres(truth)} with the true values",
    )


def _row(row: Mapping[str, Any]) -> str:
    if row["found"] is None:
        return f"  {row['gene']:24} true {row['true']:+.4f}   not named"
    ends = ", ".join("not bounded" if end is None else f"{end:+.4f}" for end in (row["low"], row["high"]))
    return f"  {row['gene']:24} true {row['true']:+.4f}   estimated {row['found']:+.4f}   90 % interval [{ends}]"


def _mm(metres: float | None) -> float | None:
    return None if metres is None else 1e3 * metres


def _millimetres(metres: float | None) -> str:
    return "unknown" if metres is None else f"{1e3 * metres:.2f} mm"
