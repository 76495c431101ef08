r"""The states of a job (a calibration or a diagnosis), as a pure state machine: no clock, no database, no threads.

``step`` takes a job and an event, and returns the job after the event and instructions for the caller. The caller
stores the returned job, then carries out the instructions in order. A request to pause or cancel a running job is
stored in the job as a *wish* until the runner (the thread that computes the job) reports its next generation. So no
finished generation is lost, and the request survives a restart of the server. A cancellation replaces a pause, and
cannot be withdrawn.

    None --submit--> QUEUED --start--> RUNNING --finish--> SUCCEEDED
                      ^  |              |   |----fail----> FAILED <--- restart, the third without progress
                      |  |              |   |----wait----> QUEUED
                      |  +---pause---+  |   |
                      |              v  |   +--wish CANCEL, then generation, finish, fail or restart
                      +--resume--- PAUSED                          |
                                     +------cancel------------> CANCELLED
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

MOST_STARTS = 3


class State(StrEnum):
    """State of a job; SUCCEEDED, FAILED and CANCELLED are final."""

    QUEUED = "QUEUED"
    RUNNING = "RUNNING"
    PAUSED = "PAUSED"
    SUCCEEDED = "SUCCEEDED"
    FAILED = "FAILED"
    CANCELLED = "CANCELLED"

    @property
    def final(self) -> bool:
        """Whether the job has ended, so that no event can change it."""
        return self in (State.SUCCEEDED, State.FAILED, State.CANCELLED)


class Wish(StrEnum):
    """A user's request to pause or cancel a running job that has not taken effect yet; NONE if there is none."""

    NONE = "NONE"
    PAUSE = "PAUSE"
    CANCEL = "CANCEL"


class Instruction(StrEnum):
    """What the caller of :func:`step` must do after storing the returned job."""

    ENQUEUE = "ENQUEUE"  # put the job at the end of the queue
    DEQUEUE = "DEQUEUE"  # take the job out of the queue
    RUN = "RUN"  # start, or continue from the last stored generation
    STORE = "STORE"  # store the generation that came with the event; in the same transaction as the job
    STOP = "STOP"  # the runner stops; without this instruction it continues with the next generation
    PUBLISH = "PUBLISH"  # the state changed: notify subscribers


@dataclass(frozen=True)
class Submit:
    """A user submitted the job."""


@dataclass(frozen=True)
class Start:
    """A runner took the job from the queue."""


@dataclass(frozen=True)
class Generation:
    """The runner finished one generation (a diagnosis: one step); ``progress`` of the whole job lies in [0, 1].

    ``lasting``: whether a restarted job can continue after this generation; if not, the generation is repeated.
    """

    progress: float
    lasting: bool = True

    def __post_init__(self) -> None:
        if not 0.0 <= self.progress <= 1.0:
            raise ValueError(f"progress is {self.progress}; it must lie in [0, 1]")


@dataclass(frozen=True)
class Pause:
    """A user requested a pause."""


@dataclass(frozen=True)
class Resume:
    """A user requested that a paused job continue, or withdrew a pause that has not happened yet."""


@dataclass(frozen=True)
class Cancel:
    """A user requested cancellation."""


@dataclass(frozen=True)
class Finish:
    """The runner computed the last step of the job."""


@dataclass(frozen=True)
class Fail:
    """The runner failed; ``error`` is shown to the user."""

    error: str


@dataclass(frozen=True)
class Wait:
    """The job cannot go on for now, because its simulator is away; it waits in the queue."""


@dataclass(frozen=True)
class Leave:
    """The server shuts down in an orderly way while the job runs; the job continues when the server starts again."""


@dataclass(frozen=True)
class Restart:
    """The server starts and finds the job stored as unfinished, though no process computes it.

    A RUNNING job was interrupted by a crash; if it was started ``most_starts`` times since its last lasting generation,
    it fails, because it may cause the crashes.
    """

    most_starts: int = MOST_STARTS


Event = Submit | Start | Generation | Pause | Resume | Cancel | Finish | Fail | Wait | Leave | Restart


@dataclass(frozen=True)
class Job:
    """A job as it is stored.

    ``generations`` counts the finished ones; ``progress`` in [0, 1] never decreases; ``error`` is set only in state
    FAILED; ``starts`` counts the starts since the last lasting generation, including the present start, and without
    those that ended by an orderly shutdown.
    """

    state: State = State.QUEUED
    wish: Wish = Wish.NONE
    generations: int = 0
    progress: float = 0.0
    error: str | None = None
    starts: int = 0


Outcome = tuple[Job, tuple[Instruction, ...]]


class IllegalTransition(ValueError):  # noqa: N818  it is a refusal more than an error, and named in the contract
    """The job's ``state`` does not allow the ``event``; ``allowed`` holds the names of the allowed events."""

    def __init__(self, job: Job | None, event: Event) -> None:
        self.state = job.state if job else None
        self.event = type(event).__name__.lower()
        self.allowed = allowed(job)
        standing = "a job that does not exist yet" if job is None else f"a job in state {job.state.value}"
        if job and job.wish is not Wish.NONE:
            standing += f" with a pending {job.wish.value.lower()}"
        choices = ", ".join(self.allowed) or "nothing: the state is final"
        super().__init__(f"cannot {self.event} {standing}; allowed: {choices}")


def allowed(job: Job | None) -> tuple[str, ...]:
    """Return the names of the events that ``step`` allows for ``job`` (None: not submitted yet), in a fixed order."""
    return tuple(type(event).__name__.lower() for event in _ONE_OF_EACH if _outcome(job, event) is not None)


def step(job: Job | None, event: Event) -> Outcome:
    """Return ``job`` (None: not submitted yet) after ``event``, and the instructions for the caller.

    IllegalTransition is raised if the job's state does not allow the event.
    """
    outcome = _outcome(job, event)
    if outcome is None:
        raise IllegalTransition(job, event)
    return outcome


_ONE_OF_EACH: tuple[Event, ...] = (
    Submit(), Start(), Generation(0.0), Pause(), Resume(), Cancel(), Finish(), Fail(""), Wait(), Leave(), Restart(),
)  # fmt: skip


def _move(job: Job, state: State, *instructions: Instruction, error: str | None = None) -> Outcome:
    """Return ``job`` in its new ``state``, with its wish cleared, and ``instructions`` followed by PUBLISH."""
    return replace(job, state=state, wish=Wish.NONE, error=error), (*instructions, Instruction.PUBLISH)


def _outcome(job: Job | None, event: Event) -> Outcome | None:
    """Return ``job`` after ``event`` and the instructions, or None if the job's state does not allow the event."""
    if job is None:
        return (Job(), (Instruction.ENQUEUE, Instruction.PUBLISH)) if isinstance(event, Submit) else None
    match job.state, event:
        case State.QUEUED, Start():
            return _move(replace(job, starts=job.starts + 1), State.RUNNING, Instruction.RUN)
        case State.QUEUED, Pause():
            return _move(job, State.PAUSED, Instruction.DEQUEUE)
        case State.QUEUED, Cancel():
            return _move(job, State.CANCELLED, Instruction.DEQUEUE)
        case State.QUEUED, Restart():
            return job, (Instruction.ENQUEUE,)
        case State.PAUSED, Resume():
            return _move(job, State.QUEUED, Instruction.ENQUEUE)
        case State.PAUSED, Cancel():
            return _move(job, State.CANCELLED)
        case State.PAUSED, Restart():
            return job, ()
        case State.RUNNING, _:
            return _while_running(job, event)
    return None


def _while_running(job: Job, event: Event) -> Outcome | None:
    cancelling = job.wish is Wish.CANCEL
    match event:
        case Generation():
            progress, starts = max(job.progress, event.progress), min(job.starts, 1) if event.lasting else job.starts
            job = replace(job, generations=job.generations + 1, progress=progress, starts=starts)
            if job.wish is Wish.NONE:
                return job, (Instruction.STORE,)
            return _move(job, State.CANCELLED if cancelling else State.PAUSED, Instruction.STORE, Instruction.STOP)
        case Pause() if not cancelling:
            return replace(job, wish=Wish.PAUSE), ()
        case Resume() if job.wish is Wish.PAUSE:
            return replace(job, wish=Wish.NONE), ()
        case Cancel():
            return replace(job, wish=Wish.CANCEL), ()
        case Finish() | Fail() if cancelling:
            return _move(job, State.CANCELLED, Instruction.STOP)
        case Finish():
            return _move(replace(job, progress=1.0), State.SUCCEEDED, Instruction.STOP)
        case Fail():
            return _move(job, State.FAILED, Instruction.STOP, error=event.error)
        case Leave() | Restart() | Wait():
            return _interrupted(job, event)
    return None


def _interrupted(job: Job, event: Leave | Restart | Wait) -> Outcome:
    """Return a running job after its server shut down (Leave) or crashed (Restart), or its simulator left (Wait)."""
    if isinstance(event, Leave):
        return replace(job, starts=max(0, job.starts - 1)), ()
    stop = (Instruction.STOP,) if isinstance(event, Wait) else ()
    if job.wish is not Wish.NONE:
        return _move(job, State.CANCELLED if job.wish is Wish.CANCEL else State.PAUSED, *stop)
    if isinstance(event, Wait):
        return _move(replace(job, starts=max(0, job.starts - 1)), State.QUEUED, *stop, Instruction.ENQUEUE)
    if job.starts >= event.most_starts:
        return _move(job, State.FAILED, error=_given_up(job))
    return _move(job, State.QUEUED, Instruction.ENQUEUE)


def _given_up(job: Job) -> str:
    return (
        f"the server ended {job.starts} times in a row while this was running, each time before a new step was "
        f"stored (after step {job.generations}), so it is not started again. It may need more memory than "
        "available; see the logs of the server and of the system. Submit it again to try once more"
    )


ETA_MEMORY = 0.2  # fraction of the elapsed time after which the weight of old progress has fallen by a factor e
ETA_LONGEST = 1e9  # s, thirty years: larger estimates are dropped


def eta_seconds(history: Sequence[tuple[float, float]]) -> float | None:
    """Return the estimated remaining time of a job in s, or None if it cannot be estimated.

    ``history`` holds (running time so far in s, progress in [0, 1]) after each generation, in order. The speed is the
    slope of a line fitted by least squares, with weights that decrease exponentially into the past: one slow generation
    changes the estimate little, a lasting change of speed soon changes it fully.
    """
    points = [(0.0, 0.0), *history]
    now, progress = points[-1]
    if progress >= 1.0:
        return 0.0
    if now <= 0.0:
        return None
    weights = [math.exp((t - now) / (ETA_MEMORY * now)) for t, _ in points]
    (spread, rise), _ = np.cov(np.transpose(points), aweights=weights, ddof=0).tolist()
    seconds = (1.0 - progress) * spread / rise if rise > 0.0 else math.inf
    return seconds if seconds < ETA_LONGEST else None
