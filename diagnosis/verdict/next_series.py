"""Propose the next recording of a rig that the user simulates: one in which the remaining hypotheses differ most.

Candidates are the recorded experiments with one thing changed: another start (genes of the recording, within their
bounds), a setting with the value of another recording, inputs of another size (up to the largest recorded one).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wingfit.calibration.estimates.linearised import free_genes, residuals_of, values_at
from wingfit.calibration.problem import Problem
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import Fit
from wingfit.diagnosis.finding import Advice
from wingfit.diagnosis.verdict.next_experiment import (
    MAX_ADVICE,
    NEARLY_CERTAIN,
    explained_by_genes,
    resolving_probability,
    rival_refits,
    rivals_in_words,
)
from wingfit.diagnosis.verdict.weigh_hypotheses import HypothesisWeights
from wingfit.inference.differences import Outputs, differences
from wingfit.inference.noise.series_fit import SeriesFit
from wingfit.records import Series
from wingfit.records.array_types import Array, Bool, Float, Mask
from wingfit.records.series import belongs_to

STARTS = (0.5, 2.0)  # times the genes of a recording
SMALLER = 0.5  # times the inputs
LEAST_CHANGE = 1.1  # times: a larger input that is less is not tried
STEPS = 16  # factors of inputs are multiples of 1 / STEPS, so that they can be sent exactly
MOVED = 0.01  # in unit coordinates: a start that changes no gene by more is the same
MOST_CANDIDATES = 16


@dataclass(frozen=True)
class Candidate:
    """A recorded experiment with changed settings or inputs, or with its own genes multiplied by ``start``."""

    recording: Series
    change: str
    start: float = 1.0


def candidates(recordings: Sequence[Series]) -> Iterator[Candidate]:
    """Yield the experiments that are compared, the recorded ones first; repeats of one experiment count once."""
    distinct = list({f"repeats {one.repeats}" if one.repeats else one.name: one for one in recordings[::-1]}.values())[
        ::-1
    ]
    for one in distinct:
        yield Candidate(one, "as it was")
    for one in distinct:
        for factor in STARTS:
            yield Candidate(one, f"with a start {factor:g} times as large", factor)
    for one in distinct:
        for name in one.settings:
            for value in sorted({other.settings[name] for other in distinct} - {one.settings[name]}):
                changed = replace(one, settings={**one.settings, name: value})
                yield Candidate(changed, f"with {name} {value:g}")
        for factor in _input_factors(one, distinct):
            changed = replace(one, inputs={name: factor * values for name, values in one.inputs.items()})
            yield Candidate(changed, f"with inputs {factor:g} times as large")


def _input_factors(one: Series, recordings: Sequence[Series]) -> Iterator[float]:
    """Yield the factors of the inputs of a recording: a smaller one, and that to the largest recorded input."""
    largest = [max(float(np.abs(r.inputs[name]).max()) for r in recordings) for name in one.inputs]
    own = [float(np.abs(values).max()) for values in one.inputs.values()]
    if not any(own):
        return
    yield SMALLER
    most = np.floor(STEPS * min(a / b for a, b in zip(largest, own, strict=True) if b > 0.0)) / STEPS
    if most >= LEAST_CHANGE:
        yield float(most)


def series_separations(
    context: FitContext, weights: HypothesisWeights
) -> Iterator[tuple[float, tuple[float, Candidate] | None]]:
    """Compute by how much the predictions of the hypotheses differ in candidate recordings.

    Yields the fraction done and, where there is one, a result (separation, candidate): the least root mean square
    difference of a rival from the most probable hypothesis, in standard deviations of the noise. Candidates are ordered
    by the difference with fixed genes. Then the rivals may adapt their genes as far as the recordings allow, until no
    other candidate can be among the best MAX_ADVICE. Yields nothing where one hypothesis is nearly certain.
    """
    rivals = rival_refits(weights)
    if len(rivals) < 2 or weights.probabilities.max() >= NEARLY_CERTAIN:
        return
    first, others = rivals[0].fit, [one.fit for one in rivals[1:]]
    tried = list(candidates([one for one in context.data.recordings if isinstance(one, Series)]))[:MOST_CANDIDATES]
    compared = list[tuple[float, _Prediction]]()
    for k, candidate in enumerate(tried):
        predicted = _Prediction.of(context, candidate, first)
        most = None if predicted is None else predicted.least(context, others, adapt=False)
        if predicted is not None and most is not None:
            compared.append((most, predicted))
        yield 0.5 * (k + 1) / len(tried), None
    found = list[float]()
    for k, (most, predicted) in enumerate(sorted(compared, key=lambda pair: -pair[0])):
        if sum(one >= most for one in found) >= MAX_ADVICE:
            return
        least = predicted.least(context, others, adapt=True)
        found += [] if least is None else [least]
        done = 0.5 + 0.5 * (k + 1) / len(compared)
        yield done, None if least is None else (least, predicted.candidate)


def rank_recordings(
    context: FitContext, weights: HypothesisWeights, apart: Sequence[tuple[float, Candidate]]
) -> tuple[Advice, ...]:
    """Return what to record next, best first, from ``apart``, the results of :func:`series_separations`."""
    between, titles = rivals_in_words(rival_refits(weights))
    return tuple(
        Advice(
            words=f"record {one.recording.name} again {one.change}: there the predictions of {titles} differ by "
            f"{size:.2g} sigma",
            separation=size,
            resolves=resolving_probability(context.data, weights, size),
            between=between,
            recording=one.recording.name,
            change=one.change,
        )
        for size, one in sorted(apart, key=lambda pair: -pair[0])[:MAX_ADVICE]
    )


@dataclass(frozen=True)
class _Prediction:
    """What the most probable hypothesis predicts in a candidate: ``candidate.recording`` holds its channels."""

    candidate: Candidate

    @classmethod
    def of(cls, context: FitContext, candidate: Candidate, first: Fit) -> _Prediction | None:
        """Simulate ``candidate`` with the hypothesis ``first``; None where that fails, or its start is not changed."""
        blank = replace(candidate.recording, values=np.where(candidate.recording.valid, 0.0, np.nan))
        unit = _started(first, candidate)
        if candidate.start != 1.0 and np.abs(unit - first.unit).max() < MOVED:
            return None
        problem = replace(first.problem, recordings=(blank,))
        values = values_at(free_genes(problem), unit[None])
        evaluation = context.evaluator.evaluate(problem, values, residuals=True)
        if evaluation.reasons[0] is not None:
            return None
        return cls(replace(candidate, recording=replace(blank, values=residuals_of(evaluation)[0][0])))

    def least(self, context: FitContext, rivals: Sequence[Fit], *, adapt: bool) -> float | None:
        """Return the least separation of ``rivals`` from the prediction; None where one cannot be simulated."""
        found = [self._separation(context, one, adapt=adapt) for one in rivals]
        known = [one for one in found if one is not None]
        return min(known) if len(known) == len(found) else None

    def _separation(self, context: FitContext, rival: Fit, *, adapt: bool) -> float | None:
        problem: Problem = replace(rival.problem, recordings=(self.candidate.recording,))

        def simulate(units: Array) -> tuple[Outputs, tuple[str | None, ...]]:
            evaluation = context.evaluator.evaluate(problem, values_at(free_genes(problem), units), residuals=True)
            return residuals_of(evaluation), evaluation.reasons

        columns = np.arange(len(rival.unit)) if adapt else np.empty(0, np.int64)
        try:
            found = differences(simulate, _started(rival, self.candidate), columns, sides=1)
        except ValueError:
            return None
        fit = context.data.like([self.candidate.recording]).reduced[0]
        if not isinstance(fit, SeriesFit):
            raise TypeError("only series are compared")
        noise = fit.scale * fit.noise
        seen = np.isfinite(found.outputs[0]) & fit.used
        white, slopes = (found.outputs[0] / noise)[seen], (found.slopes[0] / noise[:, None])[seen].T
        whole = float(white @ white)
        if adapt:
            own = _own_genes(rival, self.candidate)
            whole -= explained_by_genes(context.data, rival, white, slopes, lag1=fit.lag1, unknown=own)
        return float(np.sqrt(max(whole, 0.0) / len(white)))


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
