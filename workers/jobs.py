r"""The life of a calibration job as a pure state machine: no clock, no database, no threads.

``step`` takes a job and an event and returns the job as it is afterwards and what the caller must now do. The
caller stores the returned job, then carries out the instructions in order. A request to pause or cancel a
running job is kept as a *wish* until the runner reports its next generation, so no finished one is lost, and
a wish survives a restart of the server because it is part of the stored job. Cancelling wins.

    None --submit--> QUEUED --start--> RUNNING --finish--> SUCCEEDED
                      ^  |              |   |----fail----> FAILED <--- restart, the third without progress
                      |  +---pause---+  |   |
                      |              v  |   +--wish CANCEL, then generation, finish, fail or restart
                      +--resume--- PAUSED                          |
                                     +------cancel------------> CANCELLED
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

MOST_STARTS = 3


class State(StrEnum):
    """State of a job; the last three are final."""

    QUEUED = "QUEUED"
    RUNNING = "RUNNING"
    PAUSED = "PAUSED"
    SUCCEEDED = "SUCCEEDED"
    FAILED = "FAILED"
    CANCELLED = "CANCELLED"

    @property
    def final(self) -> bool:
        """Whether no event can change a job in this state."""
        return self in (State.SUCCEEDED, State.FAILED, State.CANCELLED)


class Wish(StrEnum):
    """Request of a user that the runner of the job has not acted on yet."""

    NONE = "NONE"
    PAUSE = "PAUSE"
    CANCEL = "CANCEL"


class Instruction(StrEnum):
    """What the caller of :func:`step` must do after it has stored the new job."""

    ENQUEUE = "ENQUEUE"
    """Put the job at the end of the queue."""
    DEQUEUE = "DEQUEUE"
    """Take the job out of the queue."""
    RUN = "RUN"
    """Start, or continue from the last stored generation."""
    STORE = "STORE"
    """Store the generation that came with the event; in the same transaction as the job."""
    STOP = "STOP"
    """The runner stops; without this instruction it continues with the next generation."""
    PUBLISH = "PUBLISH"
    """The state changed: notify subscribers."""


@dataclass(frozen=True)
class Submit:
    """A user submitted the job."""


@dataclass(frozen=True)
class Start:
    """A runner took the job from the queue."""


@dataclass(frozen=True)
class Generation:
    """The runner finished one generation; ``progress`` is the fraction of the whole job, in [0, 1].

    ``lasting``: a restart continues after this generation.
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
    """A user requested to continue, or withdrew a pause that has not happened yet."""


@dataclass(frozen=True)
class Cancel:
    """A user requested cancellation."""


@dataclass(frozen=True)
class Finish:
    """The runner reached the end."""


@dataclass(frozen=True)
class Fail:
    """The runner failed; ``error`` is shown to the user."""

    error: str


@dataclass(frozen=True)
class Leave:
    """The server shuts down in an orderly way while the job runs; the job continues after the next start."""


@dataclass(frozen=True)
class Restart:
    """The server started and found the job unfinished, without its runner.

    A job that was started ``most_starts`` times without lasting progress fails, because it may be what ends the server.
    """

    most_starts: int = MOST_STARTS


Event = Submit | Start | Generation | Pause | Resume | Cancel | Finish | Fail | Leave | Restart


@dataclass(frozen=True)
class Job:
    """A job as it is stored.

    ``progress`` never decreases; ``error`` is set only in state FAILED; ``starts`` counts the starts since the last
    lasting generation, with the present one and without those that ended by an orderly shutdown.
    """

    state: State = State.QUEUED
    wish: Wish = Wish.NONE
    generations: int = 0
    progress: float = 0.0
    error: str | None = None
    starts: int = 0


Outcome = tuple[Job, tuple[Instruction, ...]]


class IllegalTransition(ValueError):  # noqa: N818  it is a refusal more than an error, and named in the contract
    """An event that the job's state does not allow; ``allowed`` names those that it does."""

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
    """Names of the events that ``step`` allows for ``job``, in a fixed order."""
    return tuple(kind.__name__.lower() for kind, handle in _HANDLERS.items() if handle(job, _sample(kind)) is not None)


def step(job: Job | None, event: Event) -> Outcome:
    """The job after ``event``, and the instructions; IllegalTransition if the state does not allow the event."""
    outcome = _HANDLERS[type(event)](job, event)
    if outcome is None:
        raise IllegalTransition(job, event)
    return outcome


def _sample(kind: type[Event]) -> Event:
    return kind(0.0) if kind is Generation else kind("") if kind is Fail else kind()  # type: ignore[call-arg]


def _move(job: Job, state: State, *instructions: Instruction, error: str | None = None) -> Outcome:
    """Enter ``state``; a wish is then fulfilled or void."""
    return replace(job, state=state, wish=Wish.NONE, error=error), (*instructions, Instruction.PUBLISH)


def _submit(job: Job | None, _: Event) -> Outcome | None:
    return (Job(), (Instruction.ENQUEUE, Instruction.PUBLISH)) if job is None else None


def _start(job: Job | None, _: Event) -> Outcome | None:
    if job is None or job.state is not State.QUEUED:
        return None
    return _move(replace(job, starts=job.starts + 1), State.RUNNING, Instruction.RUN)


def _generation(job: Job | None, event: Event) -> Outcome | None:
    if job is None or job.state is not State.RUNNING or not isinstance(event, Generation):
        return None
    starts = min(job.starts, 1) if event.lasting else job.starts
    job = replace(job, generations=job.generations + 1, progress=max(job.progress, event.progress), starts=starts)
    if job.wish is Wish.NONE:
        return job, (Instruction.STORE,)
    state = State.CANCELLED if job.wish is Wish.CANCEL else State.PAUSED
    return _move(job, state, Instruction.STORE, Instruction.STOP)


def _pause(job: Job | None, _: Event) -> Outcome | None:
    if job is None or job.wish is Wish.CANCEL:
        return None
    if job.state is State.QUEUED:
        return _move(job, State.PAUSED, Instruction.DEQUEUE)
    return (replace(job, wish=Wish.PAUSE), ()) if job.state is State.RUNNING else None


def _resume(job: Job | None, _: Event) -> Outcome | None:
    if job is None or job.wish is Wish.CANCEL:
        return None
    if job.state is State.PAUSED:
        return _move(job, State.QUEUED, Instruction.ENQUEUE)
    return (replace(job, wish=Wish.NONE), ()) if job.wish is Wish.PAUSE else None


def _cancel(job: Job | None, _: Event) -> Outcome | None:
    if job is None or job.state.final:
        return None
    if job.state is State.RUNNING:
        return replace(job, wish=Wish.CANCEL), ()
    return _move(job, State.CANCELLED, *([Instruction.DEQUEUE] if job.state is State.QUEUED else []))


def _finish(job: Job | None, _: Event) -> Outcome | None:
    if job is None or job.state is not State.RUNNING:
        return None
    if job.wish is Wish.CANCEL:
        return _move(job, State.CANCELLED, Instruction.STOP)
    return _move(replace(job, progress=1.0), State.SUCCEEDED, Instruction.STOP)


def _fail(job: Job | None, event: Event) -> Outcome | None:
    if job is None or job.state is not State.RUNNING or not isinstance(event, Fail):
        return None
    if job.wish is Wish.CANCEL:
        return _move(job, State.CANCELLED, Instruction.STOP)
    return _move(job, State.FAILED, Instruction.STOP, error=event.error)


def _leave(job: Job | None, _: Event) -> Outcome | None:
    if job is None or job.state is not State.RUNNING:
        return None
    return replace(job, starts=max(0, job.starts - 1)), ()


def _restart(job: Job | None, event: Event) -> Outcome | None:
    if job is None or job.state.final or not isinstance(event, Restart):
        return None
    if job.state is State.QUEUED:
        return job, (Instruction.ENQUEUE,)
    if job.state is State.PAUSED:
        return job, ()
    if job.wish is not Wish.NONE:
        return _move(job, State.CANCELLED if job.wish is Wish.CANCEL else State.PAUSED)
    if job.starts >= event.most_starts:
        return _move(job, State.FAILED, error=_given_up(job))
    return _move(job, State.QUEUED, Instruction.ENQUEUE)


def _given_up(job: Job) -> str:
    return (
        f"the server ended {job.starts} times in a row while this was running, each time before a new step was "
        f"stored (after step {job.generations}), so it is not started again. It may need more memory than "
        "available; see the logs of the server and of the system. Submit it again to try once more"
    )


_HANDLERS: dict[type[Event], Callable[[Job | None, Event], Outcome | None]] = {
    Submit: _submit,
    Start: _start,
    Generation: _generation,
    Pause: _pause,
    Resume: _resume,
    Cancel: _cancel,
    Finish: _finish,
    Fail: _fail,
    Leave: _leave,
    Restart: _restart,
}

ETA_MEMORY = 0.2
"""Fraction of the elapsed time after which the weight of old progress has fallen by a factor e."""
ETA_LONGEST = 1e9  # s, thirty years: larger estimates are dropped


def eta_seconds(history: Sequence[tuple[float, float]]) -> float | None:
    """Remaining seconds, or None if they cannot be estimated.

    ``history`` holds (elapsed s of running time, progress) of each generation, in order; (0, 0) is implied. The speed
    is the slope of a line fitted by least squares with weights that decay into the past: one slow generation changes
    the estimate little, a lasting change of speed is followed.
    """
    points = [(0.0, 0.0), *history]
    now, progress = points[-1]
    if progress >= 1.0:
        return 0.0
    if now <= 0.0:
        return None
    weights = [math.exp((t - now) / (ETA_MEMORY * now)) for t, _ in points]
    total = sum(weights)
    mean_t = sum(w * t for w, (t, _) in zip(weights, points, strict=True)) / total
    mean_p = sum(w * p for w, (_, p) in zip(weights, points, strict=True)) / total
    spread = sum(w * (t - mean_t) ** 2 for w, (t, _) in zip(weights, points, strict=True))
    rise = sum(w * (t - mean_t) * (p - mean_p) for w, (t, p) in zip(weights, points, strict=True))
    seconds = (1.0 - progress) * spread / rise if rise > 0.0 else math.inf
    return seconds if seconds < ETA_LONGEST else None
