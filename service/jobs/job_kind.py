"""Interface between the runner and the kinds of job, whose computation is stored step by step."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from sqlalchemy.orm import Session

from wingfit.calibration.evaluator import Evaluator
from wingfit.client.answers import GenerationEvent, Run
from wingfit.client.diagnosis_answers import Diagnosis, StepEvent
from wingfit.client.films.answers import Tracking, TrackingStep
from wingfit.service.storage.tables import JobRow, StepOfJob

Points = list[tuple[float, float]]


class InterruptedStepError(Exception):
    """Raised within a step when the job is to be cancelled or the service stops."""


class NotReadyError(Exception):
    """Raised within a step when the job cannot go on for now: it goes back to the queue until its kind is ready."""


@dataclass(frozen=True)
class Step:
    """One finished step of a job: a generation of a run, a report of progress of another, or the final result.

    Attributes:
        progress: fraction of the whole job that is done, in [0, 1].
        store: ``store(session, row, eta_seconds)`` writes the step's results, in one transaction with the job's state;
            ``eta_seconds`` is the estimated remaining time.
        last: whether this step ends the job; its results are stored only if the job was not cancelled meanwhile.
        resumable: whether a restarted job continues after this step instead of repeating it.
    """

    progress: float
    store: Callable[[Session, Any, float | None], None]
    last: bool = False
    resumable: bool = True


class JobKind(ABC):
    """A kind of job: its resource in the API, its tables, and how one job is computed.

    Attributes:
        what: singular name of the resource, e.g. "run", also for messages.
        path: path of the resource, e.g. "/v1/runs".
        prefix: beginning of the ids of its jobs, e.g. "dx".
        step_event: name of the server-sent event that reports a step.
        table: database table of the jobs.
        step_table: database table of their steps.
        step_answer: typed dict of a step as JSON, the data of a ``step_event``.
    """

    what: str
    path: str
    prefix: str
    step_event: str
    table: type[JobRow]
    step_table: type[StepOfJob]
    step_answer: type[GenerationEvent] | type[StepEvent] | type[TrackingStep]

    @abstractmethod
    def view(self, row: Any) -> Run | Diagnosis | Tracking:
        """Return the JSON answer that describes the job stored in ``row`` (of ``table``)."""

    @abstractmethod
    def begin(self, session: Session, row: Any) -> Points:
        """Prepare ``row`` for a start or restart; return (elapsed time in s, progress) of the steps to keep."""

    @abstractmethod
    def steps(self, row: Any, evaluator: Evaluator, interrupted: Callable[[], bool]) -> Iterator[Step]:
        """Compute the job in ``row`` and yield its steps; only the final one has ``last`` True.

        InterruptedStepError soon after ``interrupted()`` returns True, within a step too; the ``evaluator`` raises it.
        """
