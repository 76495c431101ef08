"""Proposals for a rig that the user simulates: recorded experiments again, as they were or with one thing changed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wingfit.calibration.estimates.linearised import free_genes, residuals_of, values_at
from wingfit.calibration.problem import Problem
from wingfit.diagnosis.advice.advised import AdvisedCost
from wingfit.diagnosis.advice.in_beat import MOST_ADAPTED, NEARLY_CERTAIN, Step
from wingfit.diagnosis.advice.proposal import MAX_ADVICE, Proposal, nearest
from wingfit.diagnosis.advice.rivals import Prediction, Rivals
from wingfit.diagnosis.advice.series_candidates import Candidate, candidates
from wingfit.diagnosis.advice.settling import Settling, share_of
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import Fit
from wingfit.inference.differences import Outputs, differences
from wingfit.inference.noise.series_fit import SeriesFit
from wingfit.records import Series
from wingfit.records.array_types import Array, Bool, Float, Mask
from wingfit.records.series import belongs_to

MOVED = 0.01  # in unit coordinates: a start that changes no gene by more is the same
MOST_CANDIDATES = 16


@dataclass(frozen=True, eq=False)
class InSeries:
    """Looks for recordings that settle which of the ``rivals`` is right, as ``settling`` predicts."""

    context: FitContext
    rivals: Rivals
    settling: Settling

    def proposals(self) -> Iterator[Step]:
        """Yield the fraction done, and proposals as they are found; none where one hypothesis is nearly certain.

        Candidates are ordered by the difference with fixed genes, an upper bound. Then genes may adapt, until no other
        candidate can be among the best.
        """
        if len(self.rivals.numbers) < 2 or self.rivals.weights.probabilities.max() >= NEARLY_CERTAIN:
            return
        tried = list(candidates([one for one in self.context.data.recordings if isinstance(one, Series)]))
        tried = tried[:MOST_CANDIDATES]
        screened = list[tuple[float, Candidate]]()
        for k, candidate in enumerate(tried):
            shown = self._predicted(candidate)
            most = None if shown is None else self._fixed(shown)
            if shown is not None and most is not None:
                screened.append((most, shown))
            yield 0.5 * (k + 1) / len(tried), []
        found = list[float]()
        for k, (most, candidate) in enumerate(sorted(screened, key=lambda pair: -pair[0])[:MOST_ADAPTED]):
            if sum(one >= most for one in found) >= MAX_ADVICE:
                return
            proposal = self._proposal(candidate)
            found += [] if proposal is None else [proposal.separation]
            yield 0.5 + 0.5 * (k + 1) / len(screened), [] if proposal is None else [proposal]

    def _predicted(self, candidate: Candidate) -> Candidate | None:
        """Return ``candidate`` with the values that the most probable hypothesis predicts.

        None where it cannot be simulated, or its start is not changed.
        """
        first = self.rivals.refits[0].fit
        blank = replace(candidate.recording, values=np.where(candidate.recording.valid, 0.0, np.nan))
        unit = _started(first, candidate)
        if candidate.start != 1.0 and np.abs(unit - first.unit).max() < MOVED:
            return None
        problem = replace(first.problem, recordings=(blank,))
        values = values_at(free_genes(problem), unit[None])
        evaluation = self.context.evaluator.evaluate(problem, values, residuals=True)
        if evaluation.reasons[0] is not None:
            return None
        return replace(candidate, recording=replace(blank, values=residuals_of(evaluation)[0][0]))

    def _fixed(self, candidate: Candidate) -> float | None:
        """Return the least separation of the others from the first with fixed genes; None where one fails."""
        fit, found = self._reduced(candidate.recording), list[float]()
        for one in self.rivals.refits[1:]:
            seen = self._differentiated(one.fit, candidate, adapt=False)
            if seen is None:
                return None
            white = (seen[0] / (fit.scale * fit.noise))[np.isfinite(seen[0]) & fit.used]
            found.append(float(np.sqrt(np.mean(white**2))))
        return min(found)

    def _proposal(self, candidate: Candidate) -> Proposal | None:
        seen = self._simulated(candidate)
        if seen is None:
            return None
        data, name = self.context.data, candidate.recording.name
        (number,) = [r for r, one in enumerate(data.recordings) if one.name == name]
        group = next(one for one in data.experiments if number in one)
        channels = [float(one.used.sum()) for one in data.reduced]
        share = share_of(channels, channels[number])
        apart, distance = self.rivals.apart(seen, share, lambda k: _own_genes(self.rivals.refits[k].fit, candidate))
        if candidate.change == "as it was":  # it repeats the error of the model
            expected, samples, kind = self.settling.again(group[0], apart, distance), 0.0, "repeat"
        else:
            fit = data.reduced[number]
            most = data.policy.effective_samples
            samples = min(fit.features, most) if isinstance(fit, SeriesFit) else most
            expected, kind = self.settling.elsewhere(apart, distance), "condition"
        resolves = self.settling.probability(expected, share, samples)
        times = candidate.recording.times
        cost = AdvisedCost(1, len(times), float(np.ptp(times)))
        details: dict[str, Any] = {"recording": name, "change": candidate.change}
        what = f"record {name} again {candidate.change}"
        return Proposal(kind, what, nearest(apart), resolves, cost, details)  # type: ignore[arg-type]

    def _simulated(self, candidate: Candidate) -> Prediction | None:
        """Return what the rivals predict in ``candidate``; None where one cannot be simulated."""
        fit = self._reduced(candidate.recording)
        slopes, values = list[Array](), list[Array]()
        for one in self.rivals.refits:
            seen = self._differentiated(one.fit, candidate, adapt=True)
            if seen is None:
                return None
            used = np.isfinite(seen[0]) & fit.used
            noise = fit.scale * fit.noise
            values.append((seen[0] / noise)[used])
            slopes.append((seen[1] / noise[:, None])[used])
        changes = self.rivals.stacked(slopes, values)
        lag1 = float(np.clip(fit.lag1, 0.0, 0.99))
        products = changes.T @ changes
        return Prediction(products / len(changes), products * (1.0 - lag1) / (1.0 + lag1))

    def _reduced(self, recording: Series) -> SeriesFit:
        fit = self.context.data.like([recording]).reduced[0]
        if not isinstance(fit, SeriesFit):
            raise TypeError("only series are compared")
        return fit

    def _differentiated(
        self, rival: Fit, candidate: Candidate, *, adapt: bool
    ) -> tuple[Float[Array, "T C"], Float[Array, "T C F"]] | None:
        """Return the difference of the prediction of ``rival``, and its derivatives if it may ``adapt``.

        None where it cannot be simulated.
        """
        problem: Problem = replace(rival.problem, recordings=(candidate.recording,))

        def simulate(units: Array) -> tuple[Outputs, tuple[str | None, ...]]:
            evaluation = self.context.evaluator.evaluate(problem, values_at(free_genes(problem), units), residuals=True)
            return residuals_of(evaluation), evaluation.reasons

        columns = np.arange(len(rival.unit)) if adapt else np.empty(0, np.int64)
        try:
            found = differences(simulate, _started(rival, candidate), columns, sides=1)
        except ValueError:
            return None
        return found.outputs[0], found.slopes[0]


def _own_genes(fit: Fit, candidate: Candidate) -> Bool[Mask, " F"]:
    """Return True [F] for the free genes that belong to the recording of ``candidate`` alone."""
    return np.array([belongs_to(name, candidate.recording.name) for name in fit.problem.free])


def _started(fit: Fit, candidate: Candidate) -> Float[Array, " F"]:
    """Return the genes of ``fit`` in unit coordinates [F], with the start of ``candidate``."""
    if candidate.start == 1.0:
        return fit.unit
    genes = free_genes(fit.problem)
    value = fit.individual[0] * np.where(_own_genes(fit, candidate), candidate.start, 1.0)
    inside = [float(np.clip(one, gene.lower, gene.upper)) for one, gene in zip(value, genes, strict=True)]
    return np.array([float(gene.to_unit(one)) for one, gene in zip(inside, genes, strict=True)])
