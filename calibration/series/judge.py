"""Compares the best genome of a rig with every recording, estimates the errors of its genes, and states doubts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.calibration.estimates.likelihood import iterate
from wingfit.calibration.estimates.uncertainty import Correlations, GeneCovariance, Standing, uncertainty
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.preparation import Prepared
from wingfit.calibration.problem import Evaluation, Problem, base_genome
from wingfit.calibration.result import gene_results
from wingfit.calibration.series import remarks
from wingfit.calibration.series.curves import curves
from wingfit.calibration.series.misfits import compared, misfit_of, total
from wingfit.calibration.series.own_genes import OwnGenes
from wingfit.calibration.series.result import RelativeTo, SeriesResult
from wingfit.calibration.starts import START_ERRORS
from wingfit.records import Genome, SeriesDataset
from wingfit.records.blas_threads import one_blas_thread
from wingfit.rigs.rig import Rig

MOVED = 1.0  # standard errors: a gene that one more iteration moves further was not at the minimum


@one_blas_thread
def judge_series(
    ready: Prepared, rig: Rig, dataset: SeriesDataset, evaluator: Evaluator, genome: dict[str, float]
) -> SeriesResult:
    """Compare ``genome`` (all genes, by name) with every recording of ``dataset``, also those that were not fitted."""
    names = {one.name for one in ready.stages[0].recordings}
    own = OwnGenes(ready, rig)
    nominal, best = base_genome(ready.model, ready.spec.fixed), base_genome(ready.model, genome)
    for recording in dataset.recordings:
        nominal, best = (own.fitted(recording, one, evaluator) for one in (nominal, best))
    everywhere = compared(dataset, _both(ready, dataset, nominal, best, evaluator))
    fitted = [one for one in everywhere if one.recording.name in names]
    held_out = [one for one in everywhere if one.recording.name in dataset.held_out]
    relative_to: RelativeTo = "noise" if all(one.noise_is_known for one in everywhere) else "range"
    errors = _errors(ready, best, evaluator)
    beyond = remarks.beyond_noise(fitted)
    return SeriesResult(
        genes=gene_results(errors.standing, base_genome(ready.model, ready.spec.fixed), best, not beyond),
        recordings=tuple(
            misfit_of(one, fitted=one in fitted, held_out=one in held_out, relative_to=relative_to)
            for one in everywhere
        ),
        relative_to=relative_to,
        before=total(fitted, 0, relative_to),
        after=total(fitted, 1, relative_to),
        held_out_before=total(held_out, 0, relative_to),
        held_out_after=total(held_out, 1, relative_to),
        remarks=(
            *remarks.not_simulated(everywhere),
            *beyond,
            *errors.unfinished,
            *remarks.at_bounds(ready, best),
            *errors.remarks,
            *remarks.unknown_noise(fitted),
            *remarks.own_genes(own, dataset),
        ),
        curves=curves(everywhere, held_out, relative_to),
        covariance=errors.covariance,
        correlations=errors.correlations,
    )


def _both(ready: Prepared, dataset: SeriesDataset, nominal: Genome, best: Genome, evaluator: Evaluator) -> Evaluation:
    """Simulate both genomes for all recordings."""
    names = tuple(gene.name for gene in ready.model.genes)
    problem = Problem(ready.model, dataset.recordings, names, nominal)
    return evaluator.evaluate(problem, np.array([nominal.values, best.values]), residuals=True)


@dataclass(frozen=True)
class _Errors:
    """Standard errors of the genes that were searched, by name, and remarks on them and on an unfinished search."""

    standing: dict[str, Standing]
    remarks: tuple[str, ...] = ()
    unfinished: tuple[str, ...] = ()
    covariance: GeneCovariance | None = None
    correlations: tuple[Correlations, ...] = ()


def _errors(ready: Prepared, best: Genome, evaluator: Evaluator) -> _Errors:
    (stage,) = ready.stages
    problem = Problem(ready.model, stage.recordings, stage.free, best)
    try:
        known = uncertainty(problem, evaluator)
        step = next(iterate(problem, evaluator, {name: best[name] for name in stage.free}))
    except START_ERRORS:
        return _Errors({name: Standing(np.inf, False, np.inf) for name in stage.free})
    moved = {name: abs(step.values[name] - best[name]) / known.standard_errors[name] for name in stage.free}
    unfinished = remarks.unfinished(moved, MOVED)
    return _Errors(known.standing, known.remarks, unfinished, known.of_known, (known.correlations,))
