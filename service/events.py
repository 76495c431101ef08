"""Server-sent events of a job, read from the database, so that a reconnect and a first look are one thing."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass
from typing import Annotated

from fastapi import Header
from pydantic import BaseModel
from sqlalchemy.orm import Session
from starlette.concurrency import run_in_threadpool
from starlette.responses import StreamingResponse

from service.changes import Changes
from service.database import Database, DatabaseClosedError
from service.diagnosis_schemas import DiagnosisOut, StepEvent
from service.problems import ProblemError, error_item, invalid
from service.schemas import GenerationEvent, RunOut
from workers.jobs import State

HEARTBEAT_SECONDS = 15.0
CHUNK = 500
MEDIA_TYPE = "text/event-stream"
LastEventId = Annotated[
    str | None, Header(alias="Last-Event-ID", description="id of the last event that the caller has")
]


@dataclass(frozen=True)
class Told:
    """The present state of a job, and its steps after a sequence, ascending."""

    job: RunOut | DiagnosisOut
    steps: Sequence[GenerationEvent | StepEvent]

    @property
    def complete(self) -> bool:
        """Whether no step was left out."""
        return len(self.steps) < CHUNK


@dataclass(frozen=True)
class Watched:
    """A job to watch: what its steps are called, and ``look(session, after, limit)``, which reads it."""

    id: str
    step: str
    look: Callable[[Session, int, int], Told]


def answer(database: Database, changes: Changes, watched: Watched, last_event_id: str | None) -> StreamingResponse:
    """The events after ``last_event_id``; a 422 for one that no stream has sent."""
    text = (last_event_id or "0").strip()
    if not (text.isascii() and text.isdecimal() and len(text) <= 15):
        item = error_item("header.Last-Event-ID", last_event_id, "must be an id that this stream has sent")
        raise invalid("the Last-Event-ID is not one of this stream", [item])
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    return StreamingResponse(stream(database, changes, watched, int(text)), headers=headers, media_type=MEDIA_TYPE)


async def stream(database: Database, changes: Changes, watched: Watched, after: int) -> AsyncIterator[bytes]:
    """Events after sequence ``after``, until the final state is sent or the service stops."""
    sent: tuple[object, ...] | None = None
    with changes.watch(watched.id) as changed:
        while True:
            changed.clear()
            told = await run_in_threadpool(_look, database, watched, after)
            if told is None:
                return
            for step in told.steps:
                after = step.sequence
                yield _event(watched.step, step, after)
            if not told.complete:
                continue
            if sent != _standing(told.job):
                sent = _standing(told.job)
                yield _event("state", told.job, after)
            if State(told.job.state).final or changes.closed:
                return
            try:
                await asyncio.wait_for(changed.wait(), HEARTBEAT_SECONDS)
            except TimeoutError:
                yield b": alive\n\n"


def _look(database: Database, watched: Watched, after: int) -> Told | None:
    try:
        with database.read() as session:
            return watched.look(session, after, CHUNK)
    except (ProblemError, DatabaseClosedError):
        return None


def _standing(job: RunOut | DiagnosisOut) -> tuple[object, ...]:
    return job.state, job.wish, job.error


def _event(kind: str, data: BaseModel, sequence: int) -> bytes:
    # The id of a state is that of the last step sent before it: a reconnect then misses nothing.
    return f"id: {sequence}\nevent: {kind}\ndata: {data.model_dump_json()}\n\n".encode()
