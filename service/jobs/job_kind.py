"""Interface between the runner and the kinds of job (calibration, diagnosis), which compute in stored steps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from sqlalchemy.orm import Session

from wingfit.calibration.evaluator import Evaluator
from wingfit.client.answers import GenerationEvent, Run
from wingfit.client.diagnosis_answers import Diagnosis, StepEvent
from wingfit.service.storage.tables import JobRow, StepOfJob

Points = list[tuple[float, float]]


class InterruptedStepError(Exception):
    """A step was abandoned because the job is to be cancelled or the service stops."""


@dataclass(frozen=True)
class Step:
    """One finished step of a job.

    Attributes:
        progress: of the whole job, in [0, 1].
        store: ``store(session, row, eta_seconds)`` writes the results, in one transaction with the job's state.
        last: whether the job has ended; its results are stored only if it was not cancelled meanwhile.
        resumable: whether a restarted job continues after this step.
    """

    progress: float
    store: Callable[[Session, Any, float | None], None]
    last: bool = False
    resumable: bool = True


class JobKind(ABC):
    """A kind of job (run, diagnosis): its resource in the API, its tables, and how one is computed.

    Attributes:
        what: singular name of the resource, also for messages.
        path: of the resource, e.g. "/v1/runs"; ids start with ``prefix``.
        table: of the jobs.
        step_table: of their steps.
        step_event: name of the event that reports a step, whose data are a ``step_answer``.
    """

    what: str
    path: str
    prefix: str
    step_event: str
    table: type[JobRow]
    step_table: type[StepOfJob]
    step_answer: type[GenerationEvent] | type[StepEvent]

    @abstractmethod
    def view(self, row: Any) -> Run | Diagnosis:
        """The answer that describes a job."""

    @abstractmethod
    def begin(self, session: Session, row: Any) -> Points:
        """Prepare ``row`` for a start or restart; return (elapsed s, progress) of the steps that stay valid."""

    @abstractmethod
    def steps(self, row: Any, evaluator: Evaluator) -> Iterator[Step]:
        """Compute the job and yield its steps; ``last`` is True for the final one only."""
