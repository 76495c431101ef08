"""Forward selection of the terms of a law that predicts recordings which are left out of its fit.

Terms are added by forward selection: the term that best predicts recordings left out one at a time. The explained
fraction is nested: each recording is predicted by a law selected without it. What the nominal genes, refitted to all
recordings, can explain is projected out first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wingfit.diagnosis.evidence.intervals import standard_errors
from wingfit.diagnosis.finding import FreeLaw, Interval, Term
from wingfit.records.array_types import Array, Bool, Float, Index, Int, Mask

MAX_TERMS = 3  # of a law
MIN_GAIN = 0.02  # of the excess of left-out recordings that a term must explain
SIMPLER_LOSS = 0.02  # of it: a simpler term is preferred if it explains at most this much less
MIN_EXPLAINED = 0.1  # of the excess: a law that explains less is rejected
MIN_RECORDINGS = 3  # for a law
LEAST_EXCESS = 1e-6  # sum of squares beyond the noise, in standard deviations


@dataclass(frozen=True)
class NormalEquations:
    """Normal equations of R recordings in M coefficients, with the nominal genes projected out.

    ``curvature`` [R, M, M] products of the responses, ``slope`` [R, M] of these with the residual, ``power`` [R] sum of
    squares of the residual, ``count`` [R] of samples, ``size`` [M] by which coefficients were scaled.
    """

    curvature: Float[Array, "R M M"]
    slope: Float[Array, "R M"]
    power: Float[Array, " R"]
    count: Float[Array, " R"]
    size: Float[Array, " M"]

    @classmethod
    def of(cls, every: Float[Array, "R N N"], terms: int, count: Float[Array, " R"], prior: float) -> NormalEquations:
        """Return the equations from all inner products ``every`` of the N columns of each of R recordings.

        The columns are the responses to the M candidate ``terms``, those to the nominal genes, whose standard
        deviation is ``prior``, and the residual. ``count``: samples of each recording.
        """
        M, F = terms, every.shape[1] - terms - 1
        size = np.sqrt(np.einsum("rmm->m", every[:, :M, :M]) / count.sum())
        size = np.where(size > 0, size, 1.0)
        genes = slice(M, M + F)
        total = every.sum(axis=0)
        taken = np.linalg.solve(total[genes, genes] + np.eye(F) / prior**2, total[genes])  # refitted genes
        project = np.eye(M + F + 1)
        project[genes] -= taken
        project = np.delete(project, np.arange(M, M + F), axis=1)
        project[:, :M] /= size
        remaining = np.einsum("ap,rab,bq->rpq", project, every, project, optimize=True)
        return cls(remaining[:, :M, :M], remaining[:, :M, M], remaining[:, M, M], count, size)

    def without(self, remaining: int) -> NormalEquations:
        """Return the equations of all recordings but number ``remaining``."""
        kept = np.arange(len(self.power)) != remaining
        return NormalEquations(self.curvature[kept], self.slope[kept], self.power[kept], self.count[kept], self.size)

    def fit(self, terms: Int[Index, "B N"], which: Bool[Mask, " R"]) -> Float[Array, "B N"]:
        """Return coefficients [B, N] of B laws with N ``terms`` [B, N] each, from the recordings ``which`` [R]."""
        matrix = self.curvature[which].sum(axis=0)[terms[:, :, None], terms[:, None, :]]
        ridge = 1e-9 * np.einsum("bnn->bn", matrix).max(axis=1, initial=1e-300)[:, None, None]
        slope = self.slope[which].sum(axis=0)[terms]
        return np.asarray(np.linalg.solve(matrix + ridge * np.eye(terms.shape[1]), slope[..., None])[..., 0])

    def remaining(self, recording: int, terms: Int[Index, "B N"], found: Float[Array, "B N"]) -> Float[Array, " B"]:
        """Return the sum of squares [B] of a recording's residual minus B laws of ``terms`` times ``found`` [B, N]."""
        matrix = self.curvature[recording][terms[:, :, None], terms[:, None, :]]
        along = (found * self.slope[recording][terms]).sum(axis=1)
        return np.asarray(self.power[recording] + np.einsum("bn,bnm,bm->b", found, matrix, found) - 2 * along)

    def explained(self, terms: Int[Index, "B N"]) -> Float[Array, " B"]:
        """Return the fraction [B] of :attr:`excess` that each of B laws explains in recordings left out of its fit.

        ``terms`` [B, N]: the terms of each law. The recordings are left out one at a time.
        """
        after = np.zeros(len(terms))
        for r in range(len(self.power)):
            after += self.remaining(r, terms, self.fit(terms, np.arange(len(self.power)) != r)) - self.count[r]
        return np.asarray(1.0 - after / self.excess)

    @property
    def excess(self) -> float:
        """Sum of squares of all residuals beyond the noise, which contributes 1 for each whitened sample."""
        return max(float((self.power - self.count).sum()), 1e-9)


class Label(NamedTuple):
    """How a candidate term is presented: its formula, the same in words, and the unit of its coefficient."""

    formula: str
    words: str
    unit: str


def selected_law(sums: NormalEquations, labels: Sequence[Label], of: str) -> FreeLaw | None:
    """Return the law that predicts left-out recordings best; without terms if none predicts enough (MIN_EXPLAINED).

    ``labels``: of the candidate terms; ``of``: what the terms are made of, as in "of the local motion". None without a
    misfit beyond the noise.
    """
    if sums.excess <= LEAST_EXCESS:
        return None
    terms, explained = _select_terms(sums), _cross_validated(sums)
    if not len(terms) or explained < MIN_EXPLAINED:
        best = f"the best explains {100 * max(explained, 0.0):.0f} % of the excess misfit of left-out recordings"
        return FreeLaw(f"no simple law {of} predicts another recording: {best}", (), explained)
    every = np.ones(len(sums.power), bool)
    size = sums.size[terms]
    value = sums.fit(terms[None], every)[0] / size
    error = standard_errors(len(sums.power) - 1) * _jackknife(sums, terms) / size
    found = tuple(
        Term(labels[k].formula, Interval(float(v), float(v - e), float(v + e)), labels[k].unit)
        for k, v, e in zip(terms, value, error, strict=True)
    )
    words = "; and ".join(labels[k].words for k in terms)
    share = f"{100 * explained:.0f} % of the excess misfit of left-out recordings"
    return FreeLaw(f"{words}: it predicts {share}", found, explained)


def _select_terms(sums: NormalEquations) -> Index:
    """Return the indices of the terms that improve the prediction of left-out recordings enough (MIN_GAIN).

    Of candidates that explain nearly as much, the simplest is taken.
    """
    terms, before = np.zeros(0, np.int64), 0.0
    usable = np.flatnonzero(np.einsum("rmm->m", sums.curvature)[: len(sums.size)] > 0)
    while len(terms) < MAX_TERMS:
        tried = np.array([[*terms, k] for k in usable if k not in terms])
        if not len(tried):
            break
        explained = sums.explained(tried)
        if not explained.max() > before + MIN_GAIN:
            break
        best = int(np.argmax(explained >= explained.max() - SIMPLER_LOSS))
        terms, before = tried[best], float(explained[best])
    return terms


def _cross_validated(sums: NormalEquations) -> float:
    """Return the fraction of the excess of each recording explained by laws selected and fitted without it."""
    after = 0.0
    for r in range(len(sums.power)):
        terms = _select_terms(sums.without(r))[None]
        found = sums.fit(terms, np.arange(len(sums.power)) != r)
        after += float(sums.remaining(r, terms, found)[0] - sums.count[r])
    return 1.0 - after / sums.excess


def _jackknife(sums: NormalEquations, terms: Index) -> Array:
    """Return standard errors [N] of the coefficients by the jackknife over recordings (Efron 1982, Eq. 3.1)."""
    count = len(sums.power)
    each = np.array([sums.fit(terms[None], np.arange(count) != r)[0] for r in range(count)])
    return np.asarray(np.sqrt((count - 1) / count * ((each - each.mean(axis=0)) ** 2).sum(axis=0)))
