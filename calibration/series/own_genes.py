"""Fits the genes that belong to a recording alone to this recording, where it was not fitted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.calibration.estimates.likelihood import iterate
from wingfit.calibration.estimates.linearised import free_genes, unit_at, values_at
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.genetic import first_generation
from wingfit.calibration.preparation import Prepared
from wingfit.calibration.problem import Problem
from wingfit.calibration.series.beginnings import from_beginnings
from wingfit.calibration.starts import START_ERRORS
from wingfit.records import Genome, Series
from wingfit.records.array_types import Array
from wingfit.records.series import recording_gene
from wingfit.rigs.rig import Rig


@dataclass(frozen=True)
class OwnGenes:
    """The genes that belong to single recordings of a prepared calibration, and that may be fitted to these alone."""

    ready: Prepared
    rig: Rig

    def of(self, recording: Series) -> tuple[str, ...]:
        """Return the genes of ``recording`` to fit to it alone: those that the request does not fix or leave out.

        Left out are genes that are fitted in no recording and fixed in none. None for a recording that is fitted.
        """
        (stage,) = self.ready.stages
        if recording.name in (one.name for one in stage.recordings):
            return ()
        meant = {*stage.free, *self.ready.spec.fixed}
        free = [
            gene.name
            for gene in self.rig.recording_genes
            if any(recording_gene(gene.name, one.name) in meant for one in stage.recordings)
        ]
        names = (recording_gene(name, recording.name) for name in free)
        return tuple(name for name in names if name not in self.ready.spec.fixed)

    def fitted(self, recording: Series, genome: Genome, evaluator: Evaluator) -> Genome:
        """Return ``genome`` with the genes of ``recording`` fitted to it alone; unchanged where that fails.

        Gauss-Newton starts at what the beginning of the recording shows, or at a better one of random individuals, if
        the method of the calibration is one that searches.
        """
        own = self.of(recording)
        if not own:
            return genome
        problem = Problem(self.ready.model, (recording,), own, genome)
        try:
            *_, last = iterate(problem, evaluator, self._start(problem, recording, evaluator))
        except START_ERRORS:
            return genome
        return genome.replace(last.values)

    def _start(self, problem: Problem, recording: Series, evaluator: Evaluator) -> dict[str, float]:
        genes, spec = free_genes(problem), self.ready.spec
        known = problem.base.as_dict() | from_beginnings(problem, evaluator, {}).values
        values: Array = np.array([known[name] for name in problem.free])
        if spec.method != "gauss_newton":
            unit = first_generation(spec.seed, recording.name, spec.population, unit_at(genes, values).tolist())
            batch = values_at(genes, unit)
            values = batch[int(np.argmin(evaluator.evaluate(problem, batch).fitness))]
        return dict(zip(problem.free, values.tolist(), strict=True))
