"""Simulates the recordings of a plan, their derivatives with respect to genes, and the changes by effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wingfit.calibration.estimates.linearised import (
    AT_BOUND,
    free_genes,
    linearise,
    residuals_of,
    unit_at,
    values_at,
)
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Problem, base_genome
from wingfit.diagnosis.evidence.screen import off_units, size_columns, typical_units
from wingfit.diagnosis.subject import Subject
from wingfit.records import AnyRecording, Genome
from wingfit.records.array_types import Array, Float, Index
from wingfit.rigs.suspect import Suspect

SHAPE_STEP = 0.02  # of the range of a gene: a change of an effect's location or shape


@dataclass(frozen=True, eq=False)
class Columns:
    """The parameters of a plan, the columns of every change: the F free genes, then those of each effect.

    The first column of an effect is its change at its typical size, or at another size if it was simulated again.
    """

    genes: tuple[str, ...]
    effects: Mapping[str, slice]
    count: int

    @property
    def of_genes(self) -> Index:
        """Indices [F] of the genes."""
        return np.arange(len(self.genes))


@dataclass(frozen=True, eq=False)
class Simulator:
    """Simulates a rig at one genome.

    Attributes:
        subject: the rig with its nominal model.
        evaluator: simulates individuals.
        genome: values of all genes of the nominal model.
        free: names of the genes that are to be estimated.
        axes: force axes; empty for other recordings.
    """

    subject: Subject
    evaluator: Evaluator
    genome: Genome
    free: tuple[str, ...]
    axes: tuple[str, ...]

    def filled(self, blank: AnyRecording) -> AnyRecording:
        """Return ``blank`` with the simulated values; ValueError where the genome cannot be simulated."""
        model = self.subject.with_initial_motion(self.subject.model, np.array(self.genome.values))
        seen = model.observe(np.array([self.genome.values]), blank)
        if seen.reasons[0] is not None:
            raise ValueError(f"recording {blank.name!r} cannot be simulated: {seen.reasons[0]}")
        values = seen.channels[0]
        if blank.kind == "series":
            values = np.where(blank.valid, values, np.nan)
        return replace(blank, values=values)

    def slopes(self, recording: AnyRecording) -> Float[Array, "T C F"]:
        """Return the derivatives of ``recording`` with respect to the free genes, scaled to 0..1.

        A gene at a bound is moved a little inside, so that it has a derivative.
        """
        problem = Problem(self.subject.model, (recording,), self.free, self.genome, self.axes)
        genes = free_genes(problem)
        unit = unit_at(genes, np.array([self.genome[name] for name in self.free]))
        unit = np.clip(unit, AT_BOUND, 1.0 - AT_BOUND)
        return linearise(problem, self.evaluator, unit).sensitivities[0]

    def changes(self, suspect: Suspect, recording: AnyRecording, part: float = 1.0) -> Float[Array, "T C E"] | None:
        """Return the changes of ``recording`` by the genes of ``suspect``; None where it cannot be simulated.

        The first of E columns is that of ``part`` of the typical size, divided by ``part``. The others are those of the
        single sizes but one, and of the shape per unit of the range of its genes, at the typical size.
        """
        rows, scale = effect_rows(suspect, part)
        model = self.subject.with_initial_motion(self.subject.extended([suspect.name]), np.array(self.genome.values))
        free = tuple(gene.name for gene in suspect.genes)
        problem = Problem(model, (recording,), free, base_genome(model, self.genome.as_dict()), self.axes)
        evaluation = self.evaluator.evaluate(problem, values_at(free_genes(problem), rows), residuals=True)
        if any(reason is not None for reason in evaluation.reasons):
            return None
        change = np.nan_to_num(residuals_of(evaluation)[0])
        shapes = len(rows) - len(suspect.shape_genes)
        change[shapes:] -= change[0]
        return np.moveaxis(change / scale[:, None, None], 0, -1)


def effect_rows(suspect: Suspect, part: float = 1.0) -> tuple[Float[Array, "E E"], Float[Array, " E"]]:
    """Return the individuals that show what ``suspect`` changes, in unit coordinates, and the divisors of the changes.

    The first has all sizes at ``part`` of their typical values; then one for each further size alone; then one for each
    shape gene, moved by SHAPE_STEP towards the middle of its range.
    """
    off, typical, size = off_units(suspect), typical_units(suspect), size_columns(suspect)
    shape = [k for k in range(len(off)) if k not in size]
    first = typical.copy()
    first[size] = np.clip(off[size] + part * (typical[size] - off[size]), 0.0, 1.0)
    rows, scale = [first], [part]
    for k in size[1:]:
        row = typical.copy()
        row[size] = off[size]
        row[k] = first[k]
        rows.append(row)
        scale.append(part)
    for k in shape:
        row = first.copy()
        step = SHAPE_STEP if row[k] <= 0.5 else -SHAPE_STEP
        row[k] += step
        rows.append(row)
        scale.append(step)
    return np.array(rows), np.array(scale)


def columns_of(free: Sequence[str], suspects: Sequence[Suspect]) -> Columns:
    """Return the order of the parameters: genes ``free``, then the genes of each of ``suspects``."""
    effects, count = dict[str, slice](), len(free)
    for suspect in suspects:
        effects[suspect.name] = slice(count, count + len(suspect.genes))
        count += len(suspect.genes)
    return Columns(tuple(free), effects, count)
