"""What the runner computes: a kind of job (calibration, diagnosis), told in steps that are each stored."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

from sqlalchemy.orm import Session

from wingfit.calibration.evaluator import Evaluator
from wingfit.service.storage.tables import JobRow

Points = list[tuple[float, float]]


class InterruptedStepError(Exception):
    """A step was given up because the job is to be cancelled, or the service stops."""


@dataclass(frozen=True)
class Step:
    """One piece of a job that is done.

    Attributes:
        progress: of the whole job, in [0, 1].
        keep: writes what the step found: ``keep(session, row, eta_seconds)``, in one transaction with the job's state.
        last: whether the job has ended; what it ``keep`` s is then kept only if the job was not cancelled meanwhile.
        lasting: whether a job that is started again goes on after it.
    """

    progress: float
    keep: Callable[[Session, Any, float | None], None]
    last: bool = False
    lasting: bool = True


class Work(Protocol):
    """A kind of job: where its rows are, and how one is computed."""

    @property
    def what(self) -> str:
        """A job of this kind in words, for messages."""
        ...

    @property
    def table(self) -> type[JobRow]:
        """Its rows."""
        ...

    def row(self, session: Session, job_id: str) -> JobRow:
        """The job, or a 404."""
        ...

    def begin(self, session: Session, row: Any) -> Points:
        """Prepare ``row`` for a start or a restart; (elapsed s, progress) of the steps that it goes on from."""
        ...

    def steps(self, row: Any, evaluator: Evaluator) -> Iterator[Step]:
        """Compute; the last step has ``last``."""
        ...
