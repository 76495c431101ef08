"""Fit a free-form law to a load that no effect of the library explains; cross-validation selects its terms.

The missing load is a sum of few terms, each a coefficient, the same for all recordings, times a product of the local
motion, the air and the wing (:mod:`wingfit.diagnosis.location.law_features`), which are selected as
:mod:`wingfit.diagnosis.location.forward_selection` describes. The law is fitted to the tracks through their responses
to loads, not to an inferred load, which a prior has smoothed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wingfit.diagnosis.finding import FreeLaw
from wingfit.diagnosis.location.forward_selection import MIN_RECORDINGS, Label, NormalEquations, selected_law
from wingfit.diagnosis.location.law_features import Candidate, candidates
from wingfit.diagnosis.location.missing_load import GENE_ERROR_SD, Case
from wingfit.records.array_types import Array
from wingfit.sim.effects.probe import Probe
from wingfit.sim.wing.probing import StationMotion


def free_law(cases: Sequence[Case], probe: Probe, motions: Sequence[StationMotion]) -> FreeLaw | None:
    """Return a law of the missing load in ``cases`` from the ``motions`` of the model at the stations of ``probe``.

    None for fewer than three recordings, or without a misfit beyond the noise. A law without terms means that none
    predicts left-out recordings.
    """
    dictionary = list(candidates())
    if len(cases) < MIN_RECORDINGS:
        return None
    labels = [Label(one.name, one.words, one.feature.unit) for one in dictionary]
    return selected_law(_sums(cases, probe, motions, dictionary), labels, "of the local motion")


def _sums(
    cases: Sequence[Case], probe: Probe, motions: Sequence[StationMotion], dictionary: Sequence[Candidate]
) -> NormalEquations:
    loads = [
        _probe_sizes(probe, case.crossing, motion, dictionary) for case, motion in zip(cases, motions, strict=True)
    ]
    every = np.array([_products(case, U) for case, U in zip(cases, loads, strict=True)])
    count = np.array([float(len(case.residual)) for case in cases])
    return NormalEquations.of(every, len(dictionary), count, GENE_ERROR_SD)


def _products(case: Case, loads: Array) -> Array:
    """Return all inner products [M + F + 1, M + F + 1] of M + F + 1 columns of a recording.

    The columns are its responses to the M candidates, given by ``loads`` [forces, M], and to the F genes, and its
    residual.
    """
    both = np.concatenate([case.responses[:, : len(loads)], case.sensitivities, case.residual[:, None]], axis=1)
    others = both.shape[1] - len(loads)
    shown = np.zeros((both.shape[1], loads.shape[1] + others))
    shown[: len(loads), : loads.shape[1]] = loads
    shown[len(loads) :, loads.shape[1] :] = np.eye(others)
    return np.asarray(shown.T @ (both.T @ both) @ shown)


def _probe_sizes(probe: Probe, crossing: float, motion: StationMotion, dictionary: Sequence[Candidate]) -> Array:
    """Return the sizes [P, M] of the probe's P unit forces that best reproduce each of M candidate loads."""
    series = np.linalg.pinv(probe.terms(motion.phase + crossing))
    hats = np.linalg.pinv(probe.hats(motion.stations))
    fields = np.array([candidate.field(motion) for candidate in dictionary])
    return np.asarray(np.einsum("sj,mjn,kn->skm", hats, fields, series, optimize=True).reshape(probe.forces, -1))
