"""Server-sent events about a job.

They are read from the database, so that a client that reconnects gets the same events as one that stayed connected.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from typing import Annotated, Any, NamedTuple

from fastapi import Header
from pydantic_core import to_json
from sqlalchemy.orm import Session
from starlette.concurrency import run_in_threadpool
from starlette.responses import StreamingResponse

from wingfit.client.answers import GenerationEvent, Run
from wingfit.client.diagnosis_answers import Diagnosis, StepEvent
from wingfit.client.films.answers import Tracking, TrackingStep
from wingfit.service.answers import checked
from wingfit.service.auth.access import CALLER, Caller, KeyRing
from wingfit.service.http.problems import ProblemError, error_item, invalid
from wingfit.service.jobs.job_kind import JobKind
from wingfit.service.jobs.wakeups import Changes
from wingfit.service.runs.views import columns
from wingfit.service.storage import store
from wingfit.service.storage.database import Database, DatabaseClosedError
from wingfit.workers.jobs import State

HEARTBEAT_SECONDS = 15.0
STEPS_PER_READ = 500
MAX_STREAMS = 500
MEDIA_TYPE = "text/event-stream"
LastEventId = Annotated[
    str | None, Header(alias="Last-Event-ID", description="id of the last event that the client has received")
]


# A job, and its steps after a sequence number, ascending.
JobState = tuple[Run | Diagnosis | Tracking, Sequence[GenerationEvent | StepEvent | TrackingStep]]


class Watched(NamedTuple):
    """A job whose events a client wants.

    Attributes:
        id: of the job.
        step: name of the event that reports a step of the job.
        read: ``read(session, after, limit)`` returns the job and up to ``limit`` of its steps with sequence numbers
            above ``after``, as JSON answers.
    """

    id: str
    step: str
    read: Callable[[Session, int, int], JobState]


class News(NamedTuple):
    """The result of one database read about a job, as server-sent events ready to be sent.

    Attributes:
        steps: the events of new steps.
        after: sequence number of the last of these steps, or the one after which to read if there are none.
        complete: whether there are no further steps in the database.
        status: state, pending action and error of the job; a ``state`` event is sent whenever they change.
        state: the ``state`` event.
        final: whether the state is final, so that the stream ends.
    """

    steps: bytes
    after: int
    complete: bool
    status: tuple[object, ...]
    state: bytes
    final: bool


class Events:
    """The event streams of the service. Streams that wait for the same events share one database read."""

    def __init__(self, database: Database, changes: Changes, keys: KeyRing) -> None:
        self._database, self._changes, self._keys = database, changes, keys
        self._reads: dict[tuple[str, int, int], asyncio.Future[News | None]] = {}

    def answer(self, watched: Watched, last_event_id: str | None) -> StreamingResponse:
        """Return the response that streams the events after ``last_event_id`` (None: all).

        Raises a 422 for an id that no stream can have sent, a 503 if too many streams are open.
        """
        text = (last_event_id or "0").strip()
        if not (text.isascii() and text.isdecimal() and len(text) <= 15):
            item = error_item("header.Last-Event-ID", last_event_id, "must be an id that this stream has sent")
            raise invalid("the Last-Event-ID is not one of this stream", [item])
        if (streams := self._changes.watchers) >= MAX_STREAMS:
            raise ProblemError(503, "busy", f"{streams} event streams are open, the maximum; try again in some seconds")
        headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
        stream = self._stream(watched, int(text), CALLER.get())
        return StreamingResponse(stream, headers=headers, media_type=MEDIA_TYPE)

    async def _stream(self, watched: Watched, after: int, caller: Caller | None = None) -> AsyncIterator[bytes]:
        """Yield the events after sequence number ``after``, and a comment every HEARTBEAT_SECONDS without an event.

        Ends once the final state is sent, the job is deleted, the caller's API key is revoked or the service stops.
        """
        sent: tuple[object, ...] | None = None
        with self._changes.watch(watched.id) as changed:
            while True:
                changed.clear()
                news = await self._read(watched, after)
                if news is None or not self._keys.admits(caller):
                    return
                after, events = news.after, news.steps
                if news.complete and sent != news.status:
                    sent, events = news.status, events + news.state
                if events:
                    yield events
                if not news.complete:
                    continue
                if news.final or self._changes.closed:
                    return
                try:
                    await asyncio.wait_for(changed.wait(), HEARTBEAT_SECONDS)
                except TimeoutError:
                    yield b": alive\n\n"

    async def _read(self, watched: Watched, after: int) -> News | None:
        """Return the events after sequence number ``after``; None if the job was deleted or the service stops.

        Streams that need the same events of the same database version share one read: each caller's access was checked.
        """
        key = watched.id, after, self._database.version
        read = self._reads.get(key)
        if read is None:
            self._reads[key] = read = asyncio.ensure_future(run_in_threadpool(_read, self._database, watched, after))
            # Shared only while it runs: nobody reads the same again, and an error must not stay.
            read.add_done_callback(lambda _: self._reads.pop(key, None))
        return await asyncio.shield(read)


def watched(kind: JobKind, job_id: str) -> Watched:
    """Describe the job with this id to :class:`Events`: its steps are generations of a run or reports of progress."""

    def read(session: Session, after: int, limit: int) -> JobState:
        past = store.steps(session, kind.step_table, job_id, after, limit)
        job = kind.view(store.one(session, kind.table, job_id))
        return job, [checked(kind.step_answer, columns(one)) for one in past]

    return Watched(job_id, kind.step_event, read)


def described(step: str, example: str) -> dict[str, Any]:
    """Return the OpenAPI description of an event stream: the schema of one event, and ``example``.

    ``step``: name of the event that reports a step.
    """
    data = {"type": "string", "contentMediaType": "application/json"}
    properties = {"id": {"type": "string"}, "event": {"enum": [step, "state"]}, "data": data}
    schema = {"type": "object", "properties": properties, "required": list(properties)}
    return {"content": {MEDIA_TYPE: {"schema": schema, "example": example}}}


def _read(database: Database, watched: Watched, after: int) -> News | None:
    try:
        with database.read() as session:
            job, steps = watched.read(session, after, STEPS_PER_READ)
    except (ProblemError, DatabaseClosedError):
        return None
    last = steps[-1]["sequence"] if steps else after
    return News(
        steps=b"".join(_event(watched.step, step, step["sequence"]) for step in steps),
        after=last,
        complete=len(steps) < STEPS_PER_READ,
        status=(job["state"], job["pending_action"], job["error"]),
        # A state has the id of the last step sent before it, so that a client that reconnects misses nothing.
        state=_event("state", job, last),
        final=State(job["state"]).final,
    )


def _event(kind: str, data: object, sequence: int) -> bytes:
    return b"id: %d\nevent: %b\ndata: %b\n\n" % (sequence, kind.encode(), to_json(data))
