"""Which effects will be detected, at what size, and which will be confused."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from wingfit.calibration.estimates.uncertainty import PRIOR
from wingfit.diagnosis.policy import POLICY
from wingfit.inference.design import (
    after_fit,
    cosine,
    detectable_distance,
    detection_probability,
    odds_probability,
    separable_distance,
    squared_distance,
)
from wingfit.planning.outcome import ConfusedPair, PlannedEffect, PlannedSize
from wingfit.planning.simulated import Columns
from wingfit.records.array_types import Array, Float, Index
from wingfit.rigs.suspect import Suspect

FALSE_ALARM = 0.01  # probability that any effect is detected although none is there
ODDS = 20.0  # likelihood ratio from which two effects count as distinguished: "strong" (Kass and Raftery 1995)
NO_CHANGE = 1e-6  # squared distance at the typical size: the effect does not show
MOST_CONFUSED = 30  # pairs that are listed
MOST_PART = 1e3  # times the typical size: no larger size is reported


@dataclass(frozen=True, eq=False)
class Contrasts:
    """Compares ``suspects`` by what recordings say about all parameters, after the genes are fitted.

    ``rest`` [P, P]: :func:`wingfit.inference.design.after_fit`; ``whole`` [P]: squared length of each change before.
    """

    suspects: Sequence[Suspect]
    columns: Columns
    rest: Float[Array, "P P"]
    whole: Float[Array, " P"]
    power: float

    @classmethod
    def of(cls, suspects: Sequence[Suspect], columns: Columns, true: Float[Array, "P P"], power: float) -> Contrasts:
        """Return the contrasts of recordings whose likelihood has the information ``true`` [P, P]."""
        genes = columns.of_genes
        rest = after_fit(true, genes, np.full(len(genes), PRIOR**-2))
        return cls(suspects, columns, rest, np.diag(true).copy(), power)

    def column(self, name: str) -> int:
        """Return the column of the change by the effect ``name`` at its typical size."""
        return int(self.columns.effects[name].start)

    def indices(self, name: str) -> Index:
        """Return the columns of all genes of the effect ``name``."""
        part = self.columns.effects[name]
        return np.arange(part.start, part.stop)

    def distance(self, one: str, other: str | None = None) -> float:
        """Return the squared distance of the effect ``one``, at its typical size, from all forms of ``other``.

        From the nominal model if there is no other.
        """
        rival = np.empty(0, int) if other is None else self.indices(other)
        return squared_distance(self.rest, self.column(one), rival)

    def cosine(self, one: str, other: str) -> float:
        """Return the larger cosine of the two effects: of each one's typical change and all forms of the other."""
        pairs = ((one, other), (other, one))
        return max(cosine(self.rest, self.column(a), self.indices(b)) for a, b in pairs)

    def probability(self, one: str, other: str) -> float:
        """Return the probability of telling two effects of typical sizes apart, whichever of them is there."""
        return min(odds_probability(self.distance(a, b), ODDS) for a, b in ((one, other), (other, one)))

    def shown(self, name: str) -> bool:
        """Return whether the effect ``name`` changes the recordings at all."""
        return bool(self.rest[self.column(name), self.column(name)] > NO_CHANGE)

    def freedom(self, suspect: Suspect) -> int:
        """Return the number of genes of ``suspect``; sizes that are choices count as one together."""
        return len(suspect.genes) - max(len(suspect.positions) - 1, 0)

    def detected(self, suspect: Suspect) -> float:
        """Return the probability that ``suspect`` is detected at its typical size."""
        if not self.shown(suspect.name):
            return 0.0
        level = FALSE_ALARM / len(self.suspects)
        return detection_probability(self.distance(suspect.name), self.freedom(suspect), level)

    def smallest_part(self, suspect: Suspect) -> float | None:
        """Return the smallest size that is detected, divided by the typical one; None for none up to MOST_PART."""
        if not self.shown(suspect.name):
            return None
        needed = detectable_distance(self.freedom(suspect), FALSE_ALARM / len(self.suspects), self.power)
        return _part(needed, self.distance(suspect.name))


@dataclass(frozen=True, eq=False)
class Evidence:
    """The size from which a diagnosis counts an effect as evidence, by the thresholds of its policy.

    A diagnosis compares the mean square of residuals with the noise of a sample, and adds a tolerance to it, so that it
    needs larger effects than a likelihood-ratio test does (:mod:`wingfit.diagnosis.verdict.weigh_hypotheses`).

    Attributes:
        square: [P] mean square, over all samples, of each change after the genes are fitted, relative to the noise.
        recordings: number of them.
        suspects: number of effects that are compared.
    """

    square: Float[Array, " P"]
    recordings: int
    suspects: int

    @classmethod
    def of(cls, assumed: Float[Array, "P P"], columns: Columns, values: float, recordings: int) -> Evidence:
        """Return the evidence of ``recordings`` of so many ``values``, whose squares add up to ``assumed`` [P, P]."""
        genes = columns.of_genes
        rest = after_fit(assumed, genes, np.full(len(genes), PRIOR**-2))
        return cls(np.diag(rest) / values, recordings, len(columns.effects))

    def part(self, column: int, freedom: int) -> float | None:
        """Return the size that is evidence, divided by that of ``column``; ``freedom``: genes of the effect.

        The excess E of the nominal model gains nu / 2 ln((tau + E) / tau), which must exceed the cost of the genes, the
        prior of the effect, and the least evidence. tau is the tolerance, and a part of E, the form of the law.
        """
        samples = min(POLICY.effective_samples * self.recordings, POLICY.max_effective_samples)
        cost = POLICY.gene_cost * freedom + np.log(self.suspects) + POLICY.least_evidence
        ratio = np.exp(2.0 * cost / samples) - 1.0
        left = 1.0 - POLICY.form**2 * ratio
        if left <= 0.0:
            return None
        return _part(POLICY.negligible**2 * ratio / left, float(self.square[column]))


def planned_effects(contrasts: Contrasts, evidence: Evidence) -> Iterator[PlannedEffect]:
    """Yield what will be seen of each effect."""
    for suspect in contrasts.suspects:
        name = suspect.name
        column, shown = contrasts.column(name), contrasts.shown(name)
        known = contrasts.detected(suspect)
        smallest = None if suspect.positions else contrasts.smallest_part(suspect)
        whole = float(contrasts.whole[column])
        rival, near = _rival(contrasts, name)
        separable = None
        if rival is not None and shown and not suspect.positions:
            separable = _part(separable_distance(ODDS, contrasts.power), contrasts.distance(name, rival))
        yield PlannedEffect(
            name=name,
            title=suspect.title,
            family=suspect.family,
            sizes=tuple(_size(suspect, gene, smallest) for gene in suspect.size_genes),
            detection_probability=known,
            smallest_part=smallest,
            diagnosed_part=evidence.part(column, contrasts.freedom(suspect)) if smallest is not None else None,
            explained_percent=100.0 * (1.0 - float(contrasts.rest[column, column]) / whole) if whole > 0 else 0.0,
            rival=rival,
            cosine=near,
            separable_part=separable,
        )


def confused_pairs(contrasts: Contrasts) -> tuple[ConfusedPair, ...]:
    """Return pairs of effects that are detected, and not distinguished, at typical sizes, least separable first."""
    names = [one.name for one in contrasts.suspects if contrasts.detected(one) >= contrasts.power]
    found = [
        ConfusedPair(one, other, contrasts.cosine(one, other), chance)
        for one, other in combinations(names, 2)
        if (chance := contrasts.probability(one, other)) < contrasts.power
    ]
    return tuple(sorted(found, key=lambda pair: (pair.probability, -pair.cosine))[:MOST_CONFUSED])


def _rival(contrasts: Contrasts, name: str) -> tuple[str | None, float]:
    """Return the effect from whose forms that of ``name`` is least distant, and the cosine; None if there is none."""
    if not contrasts.shown(name):
        return None, 0.0
    others = [one.name for one in contrasts.suspects if one.name != name and contrasts.shown(one.name)]
    if not others:
        return None, 0.0
    near = {one: cosine(contrasts.rest, contrasts.column(name), contrasts.indices(one)) for one in others}
    best = max(near, key=lambda one: near[one])
    return best, near[best]


def _part(needed: float, distance: float) -> float | None:
    """Return the factor on a size at which its squared ``distance`` is ``needed``; None if it exceeds MOST_PART."""
    part = float(np.sqrt(needed / distance)) if distance > 0.0 else np.inf
    return part if part <= MOST_PART else None


def _size(suspect: Suspect, name: str, part: float | None) -> PlannedSize:
    gene = next(one for one in suspect.genes if one.name == name)
    typical = float(suspect.typical[name])
    smallest = None if part is None else part * typical
    inside = smallest is not None and gene.lower <= smallest <= gene.upper
    return PlannedSize(name, gene.unit, typical, smallest if inside else None)
