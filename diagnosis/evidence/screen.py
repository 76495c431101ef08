"""The score test of every suspect: how much of the misfit it would take, the nominal genes free to adapt.

A suspect is put in at the sizes at which it is met in practice, at several places and shapes, and the changes that this
makes to the simulated recordings are fitted to what is left, after what the nominal genes can do has been taken out of
both (a score test with nuisance parameters: Rao 1948; here with finite sizes: many effects have no slope at zero).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wingfit.calibration.estimates.linearised import free_genes, unit_at, values_at
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Problem, base_genome
from wingfit.diagnosis.evidence.fit import PRIOR_SD, Fit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.subject import Subject, Suspect
from wingfit.inference import score_test
from wingfit.inference.score_test import amounts, remaining, spread

Array = npt.NDArray[np.float64]

LOCATION_SAMPLES = 15  # of a suspect that acts at a place, beside the typical one: two groups of lanes
SHAPE_SAMPLES = 7  # of one with other shape genes
VISIBLE_CHANGE = 1e-3  # of the noise: a suspect that moves less than this in all is not seen


@dataclass(frozen=True)
class Trial:
    """One size (or several, one by one) of a suspect at one place: what it does.

    Attributes:
        suspect: which.
        unit: [S, E] its genes in parts of their boxes, one row for each size.
        fields: [S, D] what each changes of the coefficients.
        gain: decrease of chi-squared when they are fitted, the nominal genes adapting.
        amounts: [S] by how much each must be multiplied.
        freedom: degrees of freedom, genes of place and shape included.
        leaves: chi-squared that is then left, by the linearised model.
    """

    suspect: Suspect
    unit: Array
    fields: Array
    gain: float
    amounts: Array
    freedom: int
    remaining_chi_squared: float

    @property
    def start(self) -> Array:
        """Genes [E] of the suspect, in parts of their boxes, where the fit puts them."""
        off = off_units(self.suspect)
        size = size_columns(self.suspect)
        start = self.unit[0].copy()
        start[size] = off[size] + self.amounts @ (self.unit[:, size] - off[size])
        return np.asarray(np.clip(start, 0.0, 1.0), float)


class Nuisance:
    """What the nominal genes can do about a fit; their prior counts as F further samples.

    The prior counts as much as it does beside the misfit
    (:meth:`wingfit.diagnosis.evidence.whitened_recordings.Stack.trust`). ``left`` [D + F] is the whitened residual that
    they cannot make up for.
    """

    def __init__(self, data: WhitenedData, fit: Fit) -> None:
        weight = 1.0 / (PRIOR_SD * np.sqrt(data.likelihood_weight(fit.coefficients)))
        slopes = fit.jacobian / data.scale[:, None]
        self.scale = data.scale
        self.genes = score_test.Nuisance.of(np.vstack([slopes, weight * np.eye(slopes.shape[1])]))
        self.residual = self.genes.rest(np.concatenate([fit.coefficients / data.scale, weight * (fit.unit - 0.5)]))

    def project_out(self, changes: Array) -> Array:
        """Whitened changes [..., D + F] of coefficients [..., D], without what the genes can make up for."""
        return self.genes.rest(changes / self.scale)


def off_units(suspect: Suspect) -> Array:
    """Genes [E] in parts of their boxes with the suspect switched off."""
    return unit_at(list(suspect.genes), np.array([gene.nominal for gene in suspect.genes]))


def size_columns(suspect: Suspect) -> list[int]:
    """Columns of the genes that are its size."""
    return [k for k, gene in enumerate(suspect.genes) if gene.name in suspect.size_genes]


def score_tests(
    subject: Subject,
    data: WhitenedData,
    nominal: Fit,
    evaluator: Evaluator,
    suspects: Sequence[Suspect],
    known: Sequence[str] = (),
) -> Iterator[tuple[Suspect, list[Trial]]]:
    """Try every suspect about a fit; yields its trials, best first (none where it cannot be simulated).

    The fit is the nominal one, or has in it the suspects that are ``known``; all its genes may adapt.
    """
    nuisance = Nuisance(data, nominal)
    values = nominal.problem.base.replace(nominal.values).as_dict()
    for suspect in suspects:
        genome = nominal.problem.genomes(np.array(list(nominal.values.values())))[0]
        model = subject.with_initial_motion(subject.extended([*known, suspect.name]), genome)
        free = tuple(gene.name for gene in suspect.genes)
        problem = Problem(model, data.recordings, free, base_genome(model, values), data.axes)
        yield suspect, _suspect_trials(data, problem, nominal, evaluator, suspect, nuisance)


def _suspect_trials(
    data: WhitenedData, problem: Problem, nominal: Fit, evaluator: Evaluator, suspect: Suspect, nuisance: Nuisance
) -> list[Trial]:
    blocks = list(_genes_to_try(suspect))
    units = np.concatenate(blocks)
    found, reasons, _ = data.evaluate(problem, evaluator, values_at(free_genes(problem), units))
    bad = np.array([reason is not None for reason in reasons])
    changes = np.where(bad[:, None], 0.0, found) - np.where(bad[:, None], 0.0, nominal.coefficients)
    trials, row = [], 0
    for block in blocks:
        rows = slice(row, row + len(block))
        row += len(block)
        if not bad[rows].any():
            trials.append(_trial(suspect, block, changes[rows], nuisance))
    return sorted(trials, key=lambda trial: -trial.gain)


def _trial(suspect: Suspect, block: Array, fields: Array, nuisance: Nuisance) -> Trial:
    own, residual = nuisance.project_out(fields), nuisance.residual
    found = amounts(own, residual, _multiple_limits(suspect, block), VISIBLE_CHANGE * np.sqrt(len(residual)))
    remaining_chi_squared = remaining(own, residual, found)
    return Trial(
        suspect,
        block,
        fields,
        max(float(residual @ residual) - remaining_chi_squared, 0.0),
        found,
        len(suspect.genes),
        remaining_chi_squared,
    )


def _multiple_limits(suspect: Suspect, block: Array) -> tuple[Array, Array]:
    """Least and largest multiples [S] of each size that stay in the box."""
    off, low, high = off_units(suspect), np.zeros(len(block)), np.zeros(len(block))
    for row, unit in enumerate(block):
        column = max(size_columns(suspect), key=lambda k: abs(unit[k] - off[k]))
        move = unit[column] - off[column]
        ends = sorted(((0.0 - off[column]) / move, (1.0 - off[column]) / move))
        low[row], high[row] = ends
    return low, high


def _shapes_to_try(suspect: Suspect, typical: Array) -> list[Array]:
    """Shapes [E'] in parts of their boxes to be tried: its spots if it has any, else the ``typical`` one and others."""
    if suspect.candidate_shapes:
        genes = [gene for gene in suspect.genes if gene.name in suspect.shape_genes]
        return [unit_at(genes, np.array(spot)) for spot in suspect.candidate_shapes]
    count = LOCATION_SAMPLES if suspect.location_genes else SHAPE_SAMPLES
    return [typical, *spread(count, len(typical))]


def _genes_to_try(suspect: Suspect) -> Iterator[Array]:
    """Genes [S, E] in parts of their boxes to be tried: one row for each size, at one place and shape."""
    off, size = off_units(suspect), size_columns(suspect)
    typical = unit_at(list(suspect.genes), np.array([suspect.typical[gene.name] for gene in suspect.genes]))
    shape = [k for k in range(len(off)) if k not in size]
    for spot in _shapes_to_try(suspect, typical[shape]) if shape else [typical[shape]]:
        for part in (1.0,) if shape else (1.0, 0.3, 3.0, -1.0):
            block = []
            for k in size:
                row = off.copy()
                row[shape] = spot
                row[k] = np.clip(off[k] + part * (typical[k] - off[k]), 0.0, 1.0)
                if row[k] != off[k]:
                    block.append(row)
            if len(block) == len(size):
                yield np.array(block)
