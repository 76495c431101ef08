"""An evaluator whose individuals are simulated by drivers: processes of the user's that take simulations over HTTP."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from wingfit.calibration.problem import Misfit, Problem
from wingfit.diagnosis.advice.series_candidates import STEPS
from wingfit.records import Gene, Series
from wingfit.records.array_types import ArrayLike
from wingfit.rigs.rig_model import RigModel, Simulated, observation
from wingfit.service.jobs.job_kind import NotReadyError
from wingfit.service.rigs.board import Board, Call
from wingfit.service.rigs.kept_simulations import KeptSimulations
from wingfit.sim.model import Observation
from wingfit.workers.running_evaluator import Interrupted, RunningEvaluator
from wingfit.workers.share import Task
from wingfit.workers.watch import Standing


class DrivenEvaluator(RunningEvaluator):
    """Puts the simulations of a job on the ``board``, and waits for their results; ``kept`` has earlier ones.

    NotReadyError is raised where no driver is heard of for SILENT_SECONDS. Misfits are computed here, of the channels
    that a driver returns, so that they are the same numbers as those of other evaluators.
    """

    kind: Literal["in_process"] = "in_process"  # it needs no process of the server
    workers = 1

    def __init__(self, job_id: str, board: Board, kept: KeptSimulations) -> None:
        self._job, self._board, self._kept = job_id, board, kept

    @property
    def standing(self) -> Standing:
        """No workers of this server."""
        return Standing(0)

    def close(self) -> None:
        """Refuse further calls."""
        self._closed = True

    def _misfits(self, problem: Problem, tasks: list[Task], residuals: bool, interrupted: Interrupted) -> list[Misfit]:
        model = problem.model
        if not isinstance(model, RigModel):
            raise TypeError(f"a driver simulates rigs of the user's own, not {type(model).__name__}")
        units = [_DrivenUnit.of(problem, model, task) for task in tasks]
        results = self._results(units, interrupted)
        return [unit.misfit(problem, results, residuals=residuals) for unit in units]

    def _results(self, units: Sequence[_DrivenUnit], interrupted: Interrupted) -> dict[str, Simulated]:
        calls = {call.key: call for unit in units for call in unit.calls}
        known = self._kept.read(self._job, {call.key: unit.shape for unit in units for call in unit.calls})
        missing = [call for key, call in calls.items() if key not in known]
        if not missing:
            return known
        keys = [call.key for call in missing]
        self._board.put(self._job, missing)
        try:
            return known | self._awaited(keys, interrupted)
        finally:
            self._board.withdraw(self._job, keys)

    def _awaited(self, keys: Sequence[str], interrupted: Interrupted) -> dict[str, Simulated]:
        while (found := self._board.results(self._job, keys)) is None:
            self._check(interrupted)
            if not self._board.attended(self._job):
                raise NotReadyError("its drivers are gone")
        return found


@dataclass(frozen=True)
class _DrivenUnit:
    """A unit of work: the ``calls`` of its individuals, and which of them each individual is (``place``).

    ``shape``: (T, C) of its recording.
    """

    task: Task
    calls: list[Call]
    place: list[int]
    shape: tuple[int, ...]

    @classmethod
    def of(cls, problem: Problem, model: RigModel, task: Task) -> _DrivenUnit:
        recording = problem.recordings[task.unit.recording]
        if not isinstance(recording, Series):
            raise TypeError(f"a driver simulates series, not {recording.kind}")
        values, place = model.calls(problem.genomes(task.values), recording)
        settings, factors = _changes(recording, model)
        calls = [Call(recording.name, model.effects, one, settings, factors) for one in values]
        return cls(task, calls, place, recording.values.shape)

    def misfit(self, problem: Problem, results: dict[str, Simulated], *, residuals: bool) -> Misfit:
        seen = observation([results[call.key] for call in self.calls], self.place)
        return self.task.run(replace(problem, model=_Answered(problem.model.genes, seen)), residuals=residuals)


def _changes(recording: Series, model: RigModel) -> tuple[dict[str, float], dict[str, float]]:
    """Return in which settings and by which factors of inputs ``recording`` differs from that of the same name.

    Factors are multiples of 1 / STEPS (:func:`wingfit.diagnosis.advice.series_candidates.candidates`).
    """
    (recorded,) = [one for one in model.all_recordings if one.name == recording.name]
    settings = {name: value for name, value in recording.settings.items() if value != recorded.settings[name]}
    factors = {}
    for name, values in recording.inputs.items():
        largest = int(np.argmax(np.abs(recorded.inputs[name])))
        before = float(recorded.inputs[name][largest])
        factor = round(STEPS * float(values[largest]) / before) / STEPS if before else 1.0
        if not np.array_equal(values, factor * recorded.inputs[name]):
            raise ValueError(f"recording {recording.name!r}: a driver cannot simulate another input {name!r}")
        if factor != 1.0:
            factors[name] = factor
    if not np.array_equal(recording.times, recorded.times):
        raise ValueError(f"recording {recording.name!r}: a driver cannot simulate other times")
    return settings, factors


@dataclass(frozen=True)
class _Answered:
    """A model that has been simulated already."""

    genes: tuple[Gene, ...]
    seen: Observation

    @property
    def searched(self) -> tuple[str, ...]:
        return tuple(gene.name for gene in self.genes)

    def observe(self, genomes: ArrayLike, recording: Series) -> Observation:  # noqa: ARG002  # part of the protocol
        return self.seen
