"""Which further recordings add most: D-optimal for the genes, T-optimal for effects that would be confused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.inference.design import Information, greedy_exchange, log_determinant
from wingfit.planning.effects import Contrasts
from wingfit.planning.genes import GeneErrors
from wingfit.planning.outcome import Proposal
from wingfit.planning.rigs import Candidate, Said
from wingfit.records.array_types import Array, Int

MOST_PAIRS = 10  # pairs of effects that are distinguished
LEAST_DISTANCE = 1e-9  # squared


@dataclass(frozen=True, eq=False)
class Option:
    """A recording that could be added: a new condition, or a repetition of the planned recording ``repeats``."""

    said: Said
    candidate: Candidate | None
    repeats: str | None


@dataclass(frozen=True, eq=False)
class Additions:
    """Chooses ``count`` of ``options`` beyond what the planned recordings say, ``genes`` and ``all`` parameters.

    ``shared`` [G]: columns of the genes that all recordings have; ``pairs``: names of effects to tell apart.
    """

    options: Sequence[Option]
    genes: Information
    all: Information
    errors: GeneErrors
    contrasts: Contrasts
    shared: Int[Array, " G"]
    pairs: Sequence[tuple[str, str]]
    count: int

    def for_genes(self) -> tuple[Proposal, ...]:
        """Return the additions that minimise the determinant of the covariance of the shared genes."""
        if not len(self.shared):
            return ()
        return self._proposals(greedy_exchange(self._gene_score, len(self.options), self.count))

    def for_effects(self) -> tuple[Proposal, ...]:
        """Return the additions that maximise the mean logarithm of the distances of the pairs; none without pairs."""
        if not self.pairs:
            return ()
        return self._proposals(greedy_exchange(self._pair_score, len(self.options), self.count))

    def _gene_score(self, chosen: Sequence[int]) -> float:
        total = self.genes
        for k in chosen:
            total = total + self.options[k].said.genes
        covariance = total.covariance(self.errors.prior)
        return -log_determinant(covariance[np.ix_(self.shared, self.shared)])

    def _pair_score(self, chosen: Sequence[int]) -> float:
        if not self.pairs:
            return 0.0
        true = self.all.true + sum(self.options[k].said.all.true for k in chosen)
        found = Contrasts.of(self.contrasts.suspects, self.contrasts.columns, true, self.contrasts.power)
        distances = [min(found.distance(a, b), found.distance(b, a)) for a, b in self.pairs]
        return float(np.mean(np.log(np.maximum(distances, LEAST_DISTANCE))))

    def _proposals(self, chosen: Sequence[int]) -> tuple[Proposal, ...]:
        found = list[Proposal]()
        genes, pairs = self._gene_score([]), self._pair_score([])
        for number in range(1, len(chosen) + 1):
            option = self.options[chosen[number - 1]]
            gain = self._gene_score(chosen[:number]) - genes if len(self.shared) else 0.0
            apart = self._pair_score(chosen[:number]) - pairs
            condition = option.candidate.condition if option.candidate else {}
            words = option.candidate.words if option.candidate else f"{option.repeats} again"
            found.append(
                Proposal(
                    words=words,
                    condition=condition,
                    repeats=option.repeats,
                    beyond=option.candidate.beyond if option.candidate else (),
                    standard_error_factor=float(np.exp(-0.5 * gain / max(len(self.shared), 1))),
                    separation_factor=float(np.exp(0.5 * apart)),
                )
            )
        return tuple(found)


def pairs_to_separate(contrasts: Contrasts, confused: Sequence[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
    """Return the effects to tell apart: the ``confused`` ones or, if there are none, the most similar detected ones."""
    if confused:
        return tuple(confused[:MOST_PAIRS])
    names = [one.name for one in contrasts.suspects if contrasts.detected(one) >= contrasts.power]
    pairs = [(a, b) for k, a in enumerate(names) for b in names[k + 1 :]]
    return tuple(sorted(pairs, key=lambda pair: -contrasts.cosine(*pair))[:MOST_PAIRS])
