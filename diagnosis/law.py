"""A free-form law for a load that nothing in the library explains, found so that it predicts other recordings.

The missing load of every recording is a sum of few terms, each a coefficient, the same for all recordings, times a
product of the local motion, the air and the wing (:mod:`diagnosis.features`). Terms are taken one by one (forward
selection), each time the one with which recordings left out one by one are predicted best; the law is fitted to the
tracks themselves, through their responses to loads, and not to an inferred load, which a prior has smoothed. What is
reported as explained is predicted by laws that were selected without the recording in question.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from diagnosis.features import Candidate, Motion, candidates
from diagnosis.finding import FreeLaw, Interval, Term
from diagnosis.missing import GENES, Case
from sim.effects.probe import Probe

Array = npt.NDArray[np.float64]

MOST = 3  # terms
GAIN = 0.02  # of the excess misfit, that a term must take away of recordings left out
PLAIN = 0.02  # of it: a plainer term is taken before a better one, if no more is lost
PREDICTS = 0.1  # of the excess misfit: a law that takes less is none
FEWEST = 3  # recordings
_NINETY = 1.6449  # standard errors to either side


@dataclass(frozen=True)
class _Sums:
    """Normal equations of R recordings in M coefficients of unit size and F genes.

    ``curvature`` [R, M + F, M + F], ``slope`` [R, M + F], ``power`` [R]: sum of squares of what is lacking, ``count``
    [R] of samples. ``size`` [M] by which coefficients were multiplied to be comparable.
    """

    curvature: Array
    slope: Array
    power: Array
    count: Array
    size: Array

    def without(self, left: int) -> _Sums:
        """All recordings but one."""
        kept = np.arange(len(self.power)) != left
        return _Sums(self.curvature[kept], self.slope[kept], self.power[kept], self.count[kept], self.size)

    @property
    def genes(self) -> npt.NDArray[np.int64]:
        """Places of the genes."""
        return np.arange(len(self.size), self.slope.shape[1])

    def fit(self, terms: npt.NDArray[np.int64], which: npt.NDArray[np.bool_]) -> tuple[Array, Array]:
        """Coefficients and genes [B, Q] for ``terms`` [B, N] from the recordings ``which`` [R], and their columns."""
        columns = np.concatenate([terms, np.tile(self.genes, (len(terms), 1))], axis=1)
        prior = np.diag(np.concatenate([np.full(terms.shape[1], 1e-9), np.full(len(self.genes), GENES**-2)]))
        curvature, slope = self.curvature[which].sum(axis=0), self.slope[which].sum(axis=0)
        matrix = curvature[columns[:, :, None], columns[:, None, :]] + prior
        return np.linalg.solve(matrix, slope[columns][..., None])[..., 0], columns

    def left(self, recording: int, found: Array, columns: Array) -> Array:
        """Sum of squares [B] that ``found`` [B, Q] leave of a recording."""
        matrix = self.curvature[recording][columns[:, :, None], columns[:, None, :]]
        change = np.einsum("bq,bqr,br->b", found, matrix, found) - 2 * (found * self.slope[recording][columns]).sum(1)
        return np.asarray(self.power[recording] + change)

    def predicted(self, terms: npt.NDArray[np.int64]) -> Array:
        """Sum of squares beyond the noise [B] that ``terms`` [B, N] leave of recordings left out one by one."""
        after = np.zeros(len(terms))
        for r in range(len(self.power)):
            which = np.arange(len(self.power)) != r
            after += self.left(r, *self.fit(terms, which)) - self.count[r]
        return after

    def explained(self, terms: npt.NDArray[np.int64]) -> Array:
        """Part [B] of the excess misfit that ``terms`` [B, N] take away of recordings left out one by one."""
        return np.asarray(1.0 - self.predicted(terms) / self.excess)

    @cached_property
    def excess(self) -> float:
        """Sum of squares beyond the noise that the genes alone leave of recordings left out one by one."""
        return max(float(self.predicted(np.zeros((1, 0), np.int64))[0]), 1e-9)


def free_law(cases: Sequence[Case], probe: Probe, motions: Sequence[Motion]) -> FreeLaw | None:
    """The law of the load that ``cases`` lack, from the ``motions`` of the nominal model at the stations of ``probe``.

    None for fewer than three recordings, or where there is no misfit beyond the noise. A law without terms says that
    none was found that predicts another recording.
    """
    dictionary = list(candidates())
    if len(cases) < FEWEST:
        return None
    sums = _sums(cases, probe, motions, dictionary)
    if sums.excess <= 1e-6:
        return None
    terms = _selected(sums)
    explained = _predicted(sums)
    if not len(terms) or explained < PREDICTS:
        part = f"the best takes {100 * max(explained, 0.0):.0f} % of the excess misfit of recordings left out"
        return FreeLaw(f"no simple law of the local motion predicts another recording: {part}", (), explained)
    return _told(sums, dictionary, terms, explained)


def _sums(cases: Sequence[Case], probe: Probe, motions: Sequence[Motion], dictionary: Sequence[Candidate]) -> _Sums:
    loads = [_loads(probe, case.crossing, motion, dictionary) for case, motion in zip(cases, motions, strict=True)]
    size = np.sqrt(sum(np.square(case.responses @ U).sum(axis=0) for case, U in zip(cases, loads, strict=True)))
    size = np.where(size > 0, size, 1.0) / np.sqrt(sum(len(case.lacking) for case in cases))
    curvature, slope = [], []
    for case, U in zip(cases, loads, strict=True):
        both = np.concatenate([case.responses @ (U / size), case.sensitivities], axis=1)
        curvature.append(both.T @ both)
        slope.append(both.T @ case.lacking)
    power = np.array([float(case.lacking @ case.lacking) for case in cases])
    return _Sums(np.array(curvature), np.array(slope), power, np.array([float(len(c.lacking)) for c in cases]), size)


def _loads(probe: Probe, crossing: float, motion: Motion, dictionary: Sequence[Candidate]) -> Array:
    """Sizes of the probe's unit loads [P, M] that make each of the dictionary's loads, as well as they can."""
    series = np.linalg.pinv(probe.terms(motion.phase + crossing))
    hats = np.linalg.pinv(probe.hats(motion.stations))
    fields = np.array([candidate.field(motion) for candidate in dictionary])
    return np.asarray(np.einsum("sj,mjn,kn->skm", hats, fields, series, optimize=True).reshape(probe.size, -1))


def _selected(sums: _Sums) -> npt.NDArray[np.int64]:
    """Terms, each earning its place by what recordings left out are predicted better; plain ones come first."""
    terms, before = np.zeros(0, np.int64), 0.0
    told = np.flatnonzero(np.einsum("rmm->m", sums.curvature)[: len(sums.size)] > 0)
    while len(terms) < MOST:
        tried = np.array([[*terms, k] for k in told if k not in terms])
        explained = sums.explained(tried)
        if not explained.max() > before + GAIN:
            break
        best = int(np.argmax(explained >= explained.max() - PLAIN))
        terms, before = tried[best], float(explained[best])
    return terms


def _predicted(sums: _Sums) -> float:
    """Part of the excess misfit of each recording that a law takes away which was selected and fitted without it."""
    after = 0.0
    for r in range(len(sums.power)):
        terms = _selected(sums.without(r))[None]
        which = np.arange(len(sums.power)) != r
        after += float(sums.left(r, *sums.fit(terms, which))[0] - sums.count[r])
    return 1.0 - after / sums.excess


def _told(sums: _Sums, dictionary: Sequence[Candidate], terms: npt.NDArray[np.int64], explained: float) -> FreeLaw:
    every = np.ones(len(sums.power), bool)
    size = sums.size[terms]
    value = sums.fit(terms[None], every)[0][0, : len(terms)] / size
    error = _jackknife(sums, terms) / size
    found = tuple(
        Term(
            dictionary[k].name,
            Interval(float(v), float(v - _NINETY * e), float(v + _NINETY * e)),
            dictionary[k].feature.unit,
        )
        for k, v, e in zip(terms, value, error, strict=True)
    )
    said = "; and ".join(dictionary[k].words for k in terms)
    share = f"{100 * explained:.0f} % of the excess misfit of recordings left out"
    return FreeLaw(f"{said}: it predicts {share}", found, explained)


def _jackknife(sums: _Sums, terms: npt.NDArray[np.int64]) -> Array:
    """Standard errors [N] from what each recording changes (Efron, The Jackknife, 1982, Eq. 3.1)."""
    count = len(sums.power)
    each = np.array([sums.fit(terms[None], np.arange(count) != r)[0][0, : len(terms)] for r in range(count)])
    return np.asarray(np.sqrt((count - 1) / count * ((each - each.mean(axis=0)) ** 2).sum(axis=0)))
