"""Score tests: estimate how much of the residual each suspect would explain, the nominal genes being free to adapt.

A suspect is added at typical sizes, at several locations and shapes. The changes that it makes to the simulated
recordings are fitted to the residual, after the part that the nominal genes can explain has been projected out of both
(a score test with nuisance parameters: Rao 1948; with finite sizes, because many effects have zero slope at zero size).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.calibration.estimates.linearised import free_genes, unit_at, values_at
from wingfit.calibration.problem import Problem, base_genome
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import PRIOR_SD, Fit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.inference import score_test
from wingfit.inference.score_test import amounts, remaining, spread
from wingfit.records.array_types import Array, Float
from wingfit.rigs.suspect import Suspect

LOCATION_SAMPLES = 15  # besides the typical location; 16 in all fill the lanes of the processor twice
SHAPE_SAMPLES = 7  # for a suspect with other shape genes
LARGER = 0.5  # residual over change: a trial that changes a series by more is tried with smaller sizes too
VISIBLE_CHANGE = 1e-3  # of the noise: a trial that changes the recordings less is ignored


@dataclass(frozen=True)
class Trial:
    """One suspect, tried at one location and shape with S sizes, and the changes that these make.

    Attributes:
        suspect: the effect that is tried.
        unit: [S, E] its E genes in unit coordinates (scaled so that their bounds are 0 and 1), one row for each size.
        changes: [S, D] change of the D Fourier coefficients of all recordings by each size.
        gain: decrease of chi-squared when the sizes and the nominal genes are fitted, by the linearised model.
        multiples: [S] factors by which the fit multiplies the sizes.
        freedom: number of genes E, location and shape included; sizes that are choices count as one gene together.
        remaining_chi_squared: chi-squared after that fit.
    """

    suspect: Suspect
    unit: Float[Array, "S E"]
    changes: Float[Array, "S D"]
    gain: float
    multiples: Float[Array, " S"]
    freedom: int
    remaining_chi_squared: float

    @property
    def start(self) -> Float[Array, " E"]:
        """Genes [E] of the suspect in unit coordinates, with sizes as fitted: the start of a refit."""
        off = off_units(self.suspect)
        size = size_columns(self.suspect)
        start = self.unit[0].copy()
        start[size] = off[size] + self.multiples @ (self.unit[:, size] - off[size])
        return np.asarray(np.clip(start, 0.0, 1.0), float)


class Nuisance:
    """The genes of a fit as nuisance parameters: a score test lets them adapt before it credits a suspect.

    The prior of these F genes counts as F further samples, weighted against the likelihood at ``fit``
    (:meth:`WhitenedData.likelihood_weight`). ``residual`` [D + F]: the whitened residual without the part that the
    genes can explain; ``whiten`` is that of the data.
    """

    def __init__(self, data: WhitenedData, fit: Fit) -> None:
        weight = 1.0 / (PRIOR_SD * np.sqrt(data.likelihood_weight(fit.coefficients)))
        slopes = data.whitened_slopes(fit.jacobian)
        self.whiten = data.whiten
        self.genes = score_test.Nuisance.of(np.vstack([slopes, weight * np.eye(slopes.shape[1])]))
        self.residual = self.genes.rest(np.concatenate([data.whiten(fit.coefficients), weight * (fit.unit - 0.5)]))

    def project_out(self, changes: Float[Array, "*B D"]) -> Float[Array, "*B N"]:
        """Whiten ``changes`` [..., D] of the coefficients, and subtract the part that the F genes can explain.

        The result [..., D + F] has an additional entry for the prior of each gene.
        """
        return self.genes.rest(self.whiten(changes))


def off_units(suspect: Suspect) -> Float[Array, " E"]:
    """Return the genes [E] of ``suspect`` in unit coordinates (bounds at 0 and 1) that switch it off."""
    return unit_at(list(suspect.genes), np.array([gene.nominal for gene in suspect.genes]))


def typical_units(suspect: Suspect) -> Float[Array, " E"]:
    """Return the genes [E] of ``suspect`` in unit coordinates (bounds at 0 and 1) at its typical size and location."""
    return unit_at(list(suspect.genes), np.array([suspect.typical[gene.name] for gene in suspect.genes]))


def positions_of(suspect: Suspect) -> list[tuple[str, float]]:
    """Return each size gene of ``suspect`` that is a choice with each of its positions."""
    return [(name, position) for name, positions in suspect.positions.items() for position in positions]


def units_at_position(trial: Trial, name: str, position: float) -> Float[Array, " E"]:
    """Return the genes [E] of the suspect of ``trial`` in unit coordinates, with its size ``name`` at ``position``.

    Other sizes are off, and the shape is that of the trial.
    """
    suspect = trial.suspect
    values = [position if gene.name == name else gene.nominal for gene in suspect.genes]
    found = unit_at(list(suspect.genes), np.array(values))
    shape = [k for k in range(len(found)) if k not in size_columns(suspect)]
    found[shape] = trial.unit[0][shape]
    return np.asarray(found)


def size_columns(suspect: Suspect) -> list[int]:
    """Return the indices of the size genes among the genes of ``suspect``."""
    return [k for k, gene in enumerate(suspect.genes) if gene.name in suspect.size_genes]


def score_tests(
    context: FitContext, nominal: Fit, suspects: Sequence[Suspect], known: Sequence[str] = ()
) -> Iterator[tuple[Suspect, list[Trial]]]:
    """Score-test every suspect at a fit; yields its trials, best first (none where it cannot be simulated).

    ``nominal``: the fit of the nominal model, or of one with the suspects ``known`` added; all its genes may adapt.
    """
    nuisance = Nuisance(context.data, nominal)
    values = nominal.problem.base.replace(nominal.values).as_dict()
    for suspect in suspects:
        model = context.subject.extended([*known, suspect.name])
        model = context.subject.with_initial_motion(model, nominal.genome)
        free = tuple(gene.name for gene in suspect.genes)
        problem = context.problem(model, free, base_genome(model, values))
        yield suspect, _suspect_trials(context, problem, nominal, suspect, nuisance)


def _suspect_trials(
    context: FitContext, problem: Problem, nominal: Fit, suspect: Suspect, nuisance: Nuisance
) -> list[Trial]:
    trials = _tried(context, problem, nominal, suspect, nuisance, list(_genes_to_try(suspect)))
    if trials and context.data.kind == "series":
        smaller = list(_smaller_sizes(suspect, trials[0], nuisance))
        trials += _tried(context, problem, nominal, suspect, nuisance, smaller) if smaller else []
    return sorted(trials, key=lambda trial: -trial.gain)


def _smaller_sizes(suspect: Suspect, trial: Trial, nuisance: Nuisance) -> Iterator[Array]:
    """Yield the genes of ``trial`` [S, E] with sizes that change the recordings about as much as the residual is.

    A much larger change is not in proportion to the size, so that it shows neither the gain nor the size to expect. The
    laws at a port have bounds that the user states, without knowing how exact the recordings are.
    """
    off, size = off_units(suspect), size_columns(suspect)
    change = float(np.linalg.norm(nuisance.project_out(trial.changes), axis=-1).min())
    part = float(np.linalg.norm(nuisance.residual)) / max(change, 1e-300)
    if part >= LARGER:
        return
    for sign in (part, -part):
        genes = trial.unit.copy()
        genes[:, size] = np.clip(off[size] + sign * (trial.unit[:, size] - off[size]), 0.0, 1.0)
        if (genes[:, size] != off[size]).any(axis=1).all():
            yield genes


def _tried(
    context: FitContext,
    problem: Problem,
    nominal: Fit,
    suspect: Suspect,
    nuisance: Nuisance,
    groups: Sequence[Array],
) -> list[Trial]:
    """Return the trial of each of ``groups`` of genes [S, E] that can be simulated, best first."""
    units = np.concatenate(groups)
    found, reasons, _ = context.evaluate(problem, values_at(free_genes(problem), units))
    bad = np.array([reason is not None for reason in reasons])
    changes = np.where(bad[:, None], 0.0, found) - np.where(bad[:, None], 0.0, nominal.coefficients)
    ends = np.cumsum([len(genes) for genes in groups])[:-1]
    parts = zip(groups, np.split(changes, ends), np.split(bad, ends), strict=True)
    trials = [_trial(suspect, genes, own, nuisance) for genes, own, failed in parts if not failed.any()]
    return sorted(trials, key=lambda trial: -trial.gain)


def _trial(suspect: Suspect, genes: Array, changes: Array, nuisance: Nuisance) -> Trial:
    own, residual = nuisance.project_out(changes), nuisance.residual
    found = amounts(own, residual, _multiple_limits(suspect, genes), VISIBLE_CHANGE * np.sqrt(len(residual)))
    remaining_chi_squared = remaining(own, residual, found)
    return Trial(
        suspect,
        genes,
        changes,
        max(float(residual @ residual) - remaining_chi_squared, 0.0),
        found,
        len(suspect.genes) - max(len(suspect.positions) - 1, 0),
        remaining_chi_squared,
    )


def _multiple_limits(suspect: Suspect, genes: Array) -> tuple[Array, Array]:
    """Return the least and the largest factor [S] on each size in ``genes`` [S, E] within the bounds of its gene."""
    off, size = off_units(suspect), np.array(size_columns(suspect))
    column = size[np.abs(genes[:, size] - off[size]).argmax(axis=1)]  # of the gene that each row moves
    move = genes[np.arange(len(genes)), column] - off[column]
    low, high = np.sort([(0.0 - off[column]) / move, (1.0 - off[column]) / move], axis=0)
    return low, high


def _shapes_to_try(suspect: Suspect, typical: Array) -> list[Array]:
    """Return values [E'] in unit coordinates for the E' genes other than sizes.

    These are the suspect's candidate shapes or, if it has none, ``typical`` [E'] and others spread over the bounds.
    """
    if suspect.candidate_shapes:
        genes = [gene for gene in suspect.genes if gene.name in suspect.shape_genes]
        return [unit_at(genes, np.array(spot)) for spot in suspect.candidate_shapes]
    count = LOCATION_SAMPLES if suspect.location_genes else SHAPE_SAMPLES
    return [typical, *spread(count, len(typical))]


def _genes_to_try(suspect: Suspect) -> Iterator[Array]:
    """Yield the genes [S, E] of each trial in unit coordinates: a row for each size, at one location and shape.

    A suspect without other genes than sizes is tried at several multiples of its typical size.
    """
    off, typical, size = off_units(suspect), typical_units(suspect), size_columns(suspect)
    shape = [k for k in range(len(off)) if k not in size]
    for spot in _shapes_to_try(suspect, typical[shape]) if shape else [typical[shape]]:
        for part in (1.0,) if shape else (1.0, 0.3, 3.0, -1.0):
            genes = []
            for k in size:
                row = off.copy()
                row[shape] = spot
                row[k] = np.clip(off[k] + part * (typical[k] - off[k]), 0.0, 1.0)
                if row[k] != off[k]:
                    genes.append(row)
            if len(genes) == len(size):
                yield np.array(genes)
