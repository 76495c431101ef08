"""The load that a model lacks, from what its tracks answer to known loads: Bayesian linear inversion.

A recording shows y = H w + S g + noise: y what was recorded less what the nominal model says, H the responses to unit
loads (a :class:`sim.effects.probe.Probe`), w their sizes under this condition, S the sensitivities to the nominal genes
and g what the genes are wrong by, the same for all recordings. A priori loads are smooth along the span and in the beat;
how strong they are under each condition, and how smooth, is what makes the data most probable (evidence: MacKay, Neural
Computation 4, 1992, Eqs. 2.8-2.14). Genes may be wrong by a good part of their box.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from diagnosis.finding import Interval, MissingLoad
from sim.effects.probe import Probe

Array = npt.NDArray[np.float64]

PHASES = 36  # instants of a beat that loads are told at
GENES = 0.3  # unit coordinates: standard deviation of what the nominal genes may be wrong by
_LENGTHS = (0.12, 0.25, 0.5)  # of the span, over which loads are alike
_DECAYS = (0.0, 1.0, 2.0)  # powers of the harmonic by which the standard deviation of loads falls
_STRENGTHS = 10.0 ** np.arange(-3.0, 4.01, 0.125)  # N/m; any unit in which responses are told
TOLD = 3.0  # natural logarithm of the evidence for a load over none: less is none
SIGNIFICANT = 2.0  # standard errors
_DRAWS = 400
_FINE = 81


@dataclass(frozen=True)
class Case:
    """One recording, whitened: every number in standard deviations of independent noise.

    Attributes:
        name: of the recording.
        lacking: [D] recorded less simulated by the refitted nominal model.
        responses: [D, P] to unit loads, in the order of the probe's genes.
        sensitivities: [D, F] to the nominal genes, unit coordinates.
        crossing: drive phase (beats) at which the recorded beat starts.
    """

    name: str
    lacking: Array
    responses: Array
    sensitivities: Array
    crossing: float

    @classmethod
    def of_samples(
        cls,
        name: str,
        residuals: Array,
        noise: Array,
        memory: float,
        responses: Array,
        sensitivities: Array,
        crossing: float,
    ) -> Case:
        """From ``residuals`` [T, C] (simulated minus recorded, NaN where missing), ``responses`` [T, C, P] and
        ``sensitivities`` [T, C, F] of the samples, and the standard deviation of their noise [C] with its ``memory``.
        """
        seen = np.isfinite(residuals)
        both = np.concatenate([-residuals[..., None], responses, sensitivities], axis=2)
        both[..., 1 : 1 + responses.shape[2]] = np.nan_to_num(both[..., 1 : 1 + responses.shape[2]])
        white = np.concatenate(
            [_decorrelated(both[seen[:, c], c], np.flatnonzero(seen[:, c]), memory) / s for c, s in enumerate(noise)]
        )
        P = responses.shape[2]
        return cls(name, white[:, 0], white[:, 1 : 1 + P], white[:, 1 + P :], crossing)


def _decorrelated(values: Array, place: npt.NDArray[np.int64], memory: float) -> Array:
    """Rows [n, ...] at samples ``place``, of noise with correlation memory^apart, as rows with independent noise."""
    if not len(values):
        return values
    kept = memory ** np.diff(place)[:, None]
    return np.concatenate([values[:1], (values[1:] - kept * values[:-1]) / np.sqrt(1.0 - kept**2)])


@dataclass(frozen=True)
class Inferred:
    """Loads under each of R conditions: sizes [R, P] of the unit loads, their covariance [R, P, P], evidence [R].

    ``evidence``: natural logarithm, for a load in this recording over none; ``names`` and ``crossings`` of the
    recordings; ``genes`` [F]: what the nominal genes are wrong by at the same time, unit coordinates; ``floor`` [R]: by
    which the noise was taken to be larger than told, because no load explains the rest.
    """

    probe: Probe
    names: tuple[str, ...]
    crossings: tuple[float, ...]
    sizes: Array
    covariance: Array
    evidence: Array
    genes: Array
    floor: Array

    def fields(self, span: Array, phase: Array) -> tuple[Array, Array]:
        """Loads and standard errors [R, span, phase] at parts of the ``span`` and ``phase`` (beats) of the beat."""
        values, errors = [], []
        for r, crossing in enumerate(self.crossings):
            basis = _basis(self.probe, span, phase + crossing)
            values.append(basis @ self.sizes[r])
            errors.append(np.sqrt(np.einsum("np,pq,nq->n", basis, self.covariance[r], basis)))
        shape = (len(self.names), len(span), len(phase))
        return np.reshape(values, shape), np.reshape(errors, shape)


def _basis(probe: Probe, span: Array, phase: Array) -> Array:
    """[span * phase, P]."""
    return np.kron(probe.hats(span), probe.terms(phase))


@dataclass(frozen=True)
class LoadPlace:
    """Where and when the missing load acts: centres with 90 % intervals, and from where to where it is significant.

    ``span`` in parts of it, ``phase`` in beats from the start of the beat; None where it is spread over the whole
    beat. ``reach`` and ``lasts`` hold 90 % of it; ``lasts`` may begin below 0 or end beyond 1 where it passes the start.
    """

    span: Interval
    reach: tuple[float, float]
    phase: Interval | None
    lasts: tuple[float, float]


class _Normal:
    """Normal equations of one recording, the noise raised to what no load and no gene explains."""

    def __init__(self, case: Case) -> None:
        H, S, y = case.responses, case.sensitivities, case.lacking
        both = np.concatenate([H, S], axis=1)
        left = y - both @ np.linalg.lstsq(both, y, rcond=1e-8)[0]
        self.floor = float(np.sqrt(max(1.0, left @ left / max(len(y) - both.shape[1], 1))))
        scale = self.floor**-2
        self.A, self.B, self.C = scale * (H.T @ H), scale * (H.T @ S), scale * (S.T @ S)
        self.h, self.s = scale * (H.T @ y), scale * (S.T @ y)
        genes = np.linalg.inv(self.C + np.eye(len(self.C)) / GENES**2)
        self.alone = self.A - self.B @ genes @ self.B.T
        self.force = self.h - self.B @ genes @ self.s

    def evidence(self, root: Array) -> Array:
        """Logarithm of the evidence over that of no load, [strengths], of loads root x strength x unit normal."""
        size, turn = np.linalg.eigh(root.T @ self.alone @ root)
        told = np.maximum(size, 0.0) * _STRENGTHS[:, None] ** 2
        along = (turn.T @ root.T @ self.force) * _STRENGTHS[:, None]
        return np.asarray(0.5 * (along**2 / (1.0 + told) - np.log1p(told)).sum(axis=1))


def infer(cases: Sequence[Case], probe: Probe) -> Inferred:
    """Invert ``cases``, which share the nominal genes; ValueError where there is none."""
    if not cases:
        raise ValueError("no recording to infer a load from; give at least one")
    normals = [_Normal(case) for case in cases]
    roots = [_root(probe, length, decay) for length, decay in product(_LENGTHS, _DECAYS)]
    evidence = np.array([[normal.evidence(root) for root in roots] for normal in normals])
    best = int(np.argmax(evidence.max(axis=2).sum(axis=0)))
    strengths = _STRENGTHS[evidence[:, best].argmax(axis=1)]
    sizes, covariance, genes = _solved(normals, [strength * roots[best] for strength in strengths])
    return Inferred(
        probe,
        tuple(case.name for case in cases),
        tuple(case.crossing for case in cases),
        sizes,
        covariance,
        evidence[:, best].max(axis=1),
        genes,
        np.array([normal.floor for normal in normals]),
    )


def _root(probe: Probe, length: float, decay: float) -> Array:
    """Square root [P, P] of the covariance of loads of strength one."""
    y = np.array(probe.stations)
    alike = np.exp(-0.5 * ((y[:, None] - y) / length) ** 2) + 1e-9 * np.eye(len(y))
    order = np.arange(1, probe.harmonics + 1)
    spread = np.concatenate([[1.0], np.tile(order**-decay, 2)])
    return np.kron(np.linalg.cholesky(alike), np.diag(spread))


def _solved(normals: Sequence[_Normal], roots: Sequence[Array]) -> tuple[Array, Array, Array]:
    """Loads [R, P], their covariance [R, P, P] and the genes [F], all together: the loads are eliminated first."""
    F = len(normals[0].s)
    precision, slope = np.eye(F) / GENES**2, np.zeros(F)
    inner = []
    for one, root in zip(normals, roots, strict=True):
        V = root @ np.linalg.solve(np.eye(len(root)) + root.T @ one.A @ root, root.T)
        inner.append(V)
        precision = precision + one.C - one.B.T @ V @ one.B
        slope = slope + one.s - one.B.T @ V @ one.h
    spread = np.linalg.inv(precision)
    genes = spread @ slope
    sizes = [V @ (one.h - one.B @ genes) for one, V in zip(normals, inner, strict=True)]
    covariance = [V + V @ one.B @ spread @ one.B.T @ V for one, V in zip(normals, inner, strict=True)]
    return np.array(sizes), np.array(covariance), genes


def missing_loads(inferred: Inferred, unit: str = "N/m") -> tuple[MissingLoad, ...]:
    """The load under each condition at the probe's stations and PHASES instants from the start of the beat on."""
    phase, stations = np.arange(PHASES) / PHASES, np.array(inferred.probe.stations)
    values, errors = inferred.fields(stations, phase)
    return tuple(
        MissingLoad(name, tuple(stations.tolist()), tuple(phase.tolist()), _table(v), _table(e), unit)
        for name, v, e in zip(inferred.names, values, errors, strict=True)
    )


def missing_force(
    name: str, residuals: Array, phase: Array, noise: float, memory: float, harmonics: int = 8
) -> MissingLoad:
    """Of a recording of forces, the missing force itself: what the mean beat of one axis lacks, N.

    ``residuals`` [T] simulated minus recorded (N, NaN where missing) at ``phase`` [T] (beats from the start of the
    beat); ``noise`` its standard deviation (N) with correlation ``memory`` from sample to sample.
    """
    seen = np.isfinite(residuals)
    probe = Probe((0.0, 1.0), harmonics)
    rows = np.concatenate([-residuals[seen, None], probe.terms(phase[seen])], axis=1)
    white = _decorrelated(rows, np.flatnonzero(seen), memory) / noise
    spread = np.linalg.pinv(white[:, 1:].T @ white[:, 1:])
    at = np.arange(PHASES) / PHASES
    basis = probe.terms(at)
    values = basis @ spread @ white[:, 1:].T @ white[:, 0]
    errors = np.sqrt(np.einsum("np,pq,nq->n", basis, spread, basis))
    return MissingLoad(name, (0.0,), tuple(at.tolist()), _table(values[None]), _table(errors[None]), "N")


def _table(values: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in values.tolist())
