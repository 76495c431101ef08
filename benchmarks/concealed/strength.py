"""Measures the strength d of a hidden effect: RMS misfit after the best refit of the nominal model / RMS noise.

The refit is of noise-free data and independent of the code of the diagnosis.

Arrays: D recorded values of all recordings, F refitted genes (model parameters), B individuals (sets of genes). Unit
coordinates run from 0 to 1 over a gene's range.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.optimize import lsq_linear

from wingfit.records import Gene, Recording
from wingfit.sim.model import Model

Array = npt.NDArray[np.float64]

STEP = 0.01  # of finite differences, as a fraction of a gene's range
DAMPINGS = (
    0.0,
    1e-3,
    1e-2,
    1e-1,
    1.0,
)  # of Gauss-Newton, tried together, with shortened steps for the first PARTS of them
PART, PARTS = 0.4, 3
STEPS = 5  # at most, between two finite-difference Jacobians
SETTLED = 0.02  # relative decrease of the RMS residual below which a refit ends
FAR = 4.0  # largest factor between two strengths in one step of the search
CLOSE = 0.2  # relative error of d at which the search for a strength ends


@dataclass(frozen=True, eq=False)
class Refit:
    """Refits the nominal model to recordings, near the true values ``start`` of its genes.

    ``searched``: names of the genes that are refitted, all that the model searches if empty; others keep their true
    values.
    """

    model: Model
    start: Mapping[str, float]
    recordings: tuple[Recording, ...]
    searched: tuple[str, ...] = ()

    @cached_property
    def genes(self) -> tuple[Gene, ...]:
        """The genes that are refitted, F of them."""
        searched = self.searched or self.model.searched
        return tuple(gene for gene in self.model.genes if gene.name in searched)

    @cached_property
    def unit(self) -> Array:
        """[F] true values in unit coordinates (0 to 1 over a gene's range)."""
        return np.array([float(gene.to_unit(self.start[gene.name])) for gene in self.genes])

    def observed(self, units: Array, recordings: Sequence[Recording]) -> Array:
        """Simulated values [B, D] (m or N) of ``recordings`` for the individuals ``units`` [B, F] (unit coordinates).

        NaN for an individual that cannot be simulated.
        """
        base = np.array([self.start.get(gene.name, gene.nominal) for gene in self.model.genes])
        genomes = np.tile(base, (len(units), 1))
        names = [gene.name for gene in self.model.genes]
        for k, gene in enumerate(self.genes):
            genomes[:, names.index(gene.name)] = gene.from_unit(np.clip(units[:, k], 0.0, 1.0))
        parts, failed = [], np.zeros(len(units), bool)
        for recording in recordings:
            found = self.model.observe(genomes, recording)
            failed |= [reason is not None for reason in found.reasons]
            parts.append(found.channels.reshape(len(units), -1))
        seen = np.concatenate(parts, axis=1)
        seen[failed] = np.nan
        return seen

    @cached_property
    def nominal(self) -> Array:
        """Simulated values [D] of all recordings at the true genes; RuntimeError if they cannot be simulated."""
        return np.asarray(_whole(self.observed(self.unit[None], self.recordings))[0])

    @cached_property
    def tangent(self) -> Array:
        """Jacobian [D, F] of the simulated values by the unit coordinates, at the true genes."""
        return self.tangent_at(self.unit, self.recordings)

    def tangent_at(self, unit: Array, recordings: Sequence[Recording]) -> Array:
        """Jacobian [D, F] at ``unit`` [F] by central differences; RuntimeError if a simulation near there fails."""
        moves = STEP * np.eye(len(self.genes))
        around = np.clip(np.vstack([unit + moves, unit - moves]), 0.0, 1.0)
        seen = _whole(self.observed(around, recordings))
        n = len(self.genes)
        width = np.diag(around[:n] - around[n:])
        return np.asarray(((seen[:n] - seen[n:]) / width[:, None]).T)

    def _slopes(self, unit: Array, recordings: Sequence[Recording], seen: Array) -> Array:
        """Jacobian [D, F] at ``unit`` by one-sided differences from the simulated values ``seen`` [D] there.

        Less accurate than :meth:`tangent_at`, but sufficient for Gauss-Newton steps.
        """
        sign = np.where(unit > 1.0 - STEP, -1.0, 1.0)
        around = self.observed(unit + STEP * np.diag(sign), recordings)
        return np.asarray(((_whole(around) - seen) * sign[:, None] / STEP).T)

    def linear(self, change: Array) -> float:
        """RMS residual (m or N) of a linearised refit to a ``change`` [D] of the recordings, genes within their ranges.

        Linearised by :attr:`tangent`, so that no simulation is needed once this Jacobian is known.
        """
        known = np.isfinite(change)
        slopes = self.tangent[known]
        return rms(slopes @ _bounded(slopes, -change[known], self.unit, 0.0) - change[known])

    def full(self, change: Array, *, rounds: int = 1, near: Sequence[Array] = ()) -> tuple[float, Array]:
        """RMS residual (m or N) of a full, nonlinear refit, and the genes [F] (unit coordinates) where it ends.

        The data are the nominal model's own values plus ``change``, so a coarse discretisation of the model has no
        influence. The refit starts from the best of the true values and all ``near`` [F].
        """
        unit, residual = self.refitted(self.nominal + change, rounds, near)
        return rms(residual), unit

    def refitted(self, target: Array, rounds: int = 1, near: Sequence[Array] = ()) -> tuple[Array, Array]:
        """Genes [F] (unit coordinates) and residual [D] of a refit to ``target`` [D].

        Gauss-Newton with several dampings at once, of which the best is taken. The Jacobian is updated after every step
        (Broyden 1965), and is evaluated again at the start of each of ``rounds``, except at the true values, where
        :attr:`tangent` is used. The refit starts from the best of the true values and all ``near`` [F].
        """
        recordings = with_values(self.recordings, target)
        starts = np.stack([self.unit, *near])
        seen = self.observed(starts, recordings) - target
        best = _best(seen, np.isfinite(target))
        unit, residual = starts[best], _whole(seen[best][None])[0]
        for turn in range(rounds):
            before = rms(residual)
            try:
                slopes = self.tangent if turn == 0 and best == 0 else self._slopes(unit, recordings, residual + target)
            except RuntimeError:
                break
            unit, residual = self._descended(recordings, target, unit, residual, slopes[np.isfinite(target)])
            if rms(residual) > (1 - SETTLED) * before:
                break
        return unit, residual

    def _descended(
        self, recordings: Sequence[Recording], target: Array, unit: Array, residual: Array, slopes: Array
    ) -> tuple[Array, Array]:
        known = np.isfinite(target)
        for _ in range(STEPS):
            whole = np.array([_bounded(slopes, residual[known], unit, damping) for damping in DAMPINGS])
            moves = np.concatenate([whole, PART * whole[:PARTS]])
            found = self.observed(unit + moves, recordings) - target
            for k in _order(found, known)[::-1]:  # the best last: the updated Jacobian reproduces its change exactly
                slopes = _learned(slopes, moves[k], (found[k] - residual)[known])
            best, before = _best(found, known), rms(residual)
            if not _left(found[best], known) < before:
                break
            unit, residual = unit + moves[best], found[best]
            if rms(residual) > (1 - SETTLED) * before:
                break
        return unit, residual


def _left(residual: Array, known: npt.NDArray[np.bool_]) -> float:
    """RMS of ``residual`` [D] of one individual; infinite if it could not be simulated.

    ``known`` [D]: mask of the samples that were recorded.
    """
    return rms(residual) if np.isfinite(residual[known]).all() else math.inf


def _order(residuals: Array, known: npt.NDArray[np.bool_]) -> list[int]:
    """Row numbers of ``residuals`` [B, D] that could be simulated, smallest RMS first."""
    left = [_left(one, known) for one in residuals]
    return [int(k) for k in np.argsort(left) if left[k] < math.inf]


def _best(residuals: Array, known: npt.NDArray[np.bool_]) -> int:
    return next(iter(_order(residuals, known)), 0)


def _whole(seen: Array) -> Array:
    if np.isnan(seen).all(axis=1).any():
        raise RuntimeError("the nominal model has no periodic motion near these genes; draw others")
    return seen


def _learned(slopes: Array, move: Array, change: Array) -> Array:
    length = float(move @ move)
    return slopes if length < 1e-12 else slopes + np.outer(change - slopes @ move, move) / length


def _bounded(slopes: Array, residual: Array, unit: Array, damping: float) -> Array:
    curvature = slopes.T @ slopes
    diagonal = np.diag(curvature)
    raised = curvature + np.diag(damping * diagonal + 1e-9 * diagonal.max())
    factor = np.linalg.cholesky(raised)
    aim = -np.linalg.solve(factor, slopes.T @ residual)
    return np.asarray(lsq_linear(factor.T, aim, (-unit - 1e-12, 1 - unit + 1e-12), method="bvls").x)


def with_values(recordings: Sequence[Recording], values: Array) -> tuple[Recording, ...]:
    """Copies of the recordings with ``values`` [D] in place of their own; the inverse of :func:`stacked`."""
    ends = np.cumsum([one.values.size for one in recordings])[:-1]
    parts = np.split(values, ends)
    return tuple(
        replace(one, values=part.reshape(one.values.shape)) for one, part in zip(recordings, parts, strict=True)
    )


def stacked(recordings: Sequence[Recording]) -> Array:
    """Values of all channels of all recordings, one after the other, [D] (m or N)."""
    return np.concatenate([one.values.ravel() for one in recordings])


def rms(values: Array) -> float:
    """Root mean square of the finite values; 0 if there are none."""
    finite = values[np.isfinite(values)]
    return math.sqrt(float(finite @ finite) / len(finite)) if len(finite) else 0.0


def strength_for(
    target: float, misfit: Callable[[float], float], start: float, limits: tuple[float, float], tries: int = 4
) -> tuple[float, float]:
    """The strength at which ``misfit`` is near ``target``, and the misfit there, by a secant method in logarithms.

    ``start``: first strength; ``limits``: smallest and largest strength, of which one is returned if ``target`` lies
    beyond it; ``tries``: number of secant steps. An ArithmeticError of ``misfit`` means that the rig cannot be
    simulated at that strength, and the step is halved; one at ``start`` is passed on.
    """
    low, high = limits
    at = min(max(start, low), high)
    found = misfit(at)
    best, power = (at, found), 1.0
    for _ in range(tries):
        if _off(found, target) < CLOSE:
            return at, found
        ratio = target / max(found, 1e-12)
        ahead = min(max(at * ratio ** (1 / power), at / FAR, low), at * FAR, high)
        if ahead == at:
            break
        try:
            value = misfit(ahead)
        except ArithmeticError:
            high = math.sqrt(at * ahead) if ahead > at else high
            low = math.sqrt(at * ahead) if ahead < at else low
            continue
        if value > 0 and found > 0 and value != found:
            power = min(max(math.log(value / found) / math.log(ahead / at), 0.3), 3.0)
        at, found = ahead, value
        best = min(best, (at, found), key=lambda one: _off(one[1], target))
    return best


def _off(found: float, target: float) -> float:
    return abs(math.log(max(found, 1e-12) / target))
