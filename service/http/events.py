"""Server-sent events of a job, read from the database, so that a reconnect and a first look are one thing."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import Header
from pydantic_core import to_json
from sqlalchemy.orm import Session
from starlette.concurrency import run_in_threadpool
from starlette.responses import StreamingResponse

from wingfit.client.answers import GenerationEvent, Run
from wingfit.client.diagnosis_answers import Diagnosis, StepEvent
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
CHUNK = 500
MOST_STREAMS = 500
MEDIA_TYPE = "text/event-stream"
LastEventId = Annotated[
    str | None, Header(alias="Last-Event-ID", description="id of the last event that the caller has")
]


@dataclass(frozen=True)
class Told:
    """The present state of a job, and its steps after a sequence, ascending."""

    job: Run | Diagnosis
    steps: Sequence[GenerationEvent | StepEvent]


@dataclass(frozen=True)
class Watched:
    """A job to watch: what its steps are called, and ``look(session, after, limit)``, which reads it."""

    id: str
    step: str
    look: Callable[[Session, int, int], Told]


@dataclass(frozen=True)
class Seen:
    """What a look found, as it goes out.

    Attributes:
        steps: their events.
        after: sequence of the last of them.
        complete: whether no step was left out.
        standing: what tells one state from another.
        state: its event.
        final: whether it is the last.
    """

    steps: bytes
    after: int
    complete: bool
    standing: tuple[object, ...]
    state: bytes
    final: bool


class Events:
    """The event streams of one service. Who waits for the same event shares the look at it."""

    def __init__(self, database: Database, changes: Changes, keys: KeyRing) -> None:
        self._database, self._changes, self._keys = database, changes, keys
        self._looks: dict[tuple[str, int, int], asyncio.Future[Seen | None]] = {}

    def answer(self, watched: Watched, last_event_id: str | None) -> StreamingResponse:
        """The events after ``last_event_id``; a 422 for one that no stream has sent, a 503 where too many are open."""
        text = (last_event_id or "0").strip()
        if not (text.isascii() and text.isdecimal() and len(text) <= 15):
            item = error_item("header.Last-Event-ID", last_event_id, "must be an id that this stream has sent")
            raise invalid("the Last-Event-ID is not one of this stream", [item])
        if (opened := self._changes.watchers) >= MOST_STREAMS:
            raise ProblemError(
                503, "busy", f"{opened} event streams are open, the most that may; try again in some seconds"
            )
        headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
        stream = self._stream(watched, int(text), CALLER.get())
        return StreamingResponse(stream, headers=headers, media_type=MEDIA_TYPE)

    async def _stream(self, watched: Watched, after: int, caller: Caller | None = None) -> AsyncIterator[bytes]:
        """Events after sequence ``after``, until the final state is sent, the key is revoked or the service stops."""
        sent: tuple[object, ...] | None = None
        with self._changes.watch(watched.id) as changed:
            while True:
                changed.clear()
                seen = await self._seen(watched, after)
                if seen is None or not self._keys.admits(caller):
                    return
                after, news = seen.after, seen.steps
                if seen.complete and sent != seen.standing:
                    sent, news = seen.standing, news + seen.state
                if news:
                    yield news
                if not seen.complete:
                    continue
                if seen.final or self._changes.closed:
                    return
                try:
                    await asyncio.wait_for(changed.wait(), HEARTBEAT_SECONDS)
                except TimeoutError:
                    yield b": alive\n\n"

    async def _seen(self, watched: Watched, after: int) -> Seen | None:
        """What follows ``after``; None where there is no such job any more.

        Every watcher was let in before, so each may see what the first one that looks sees. Of the same version of the
        database all see the same.
        """
        key = watched.id, after, self._database.version
        look = self._looks.get(key)
        if look is None:
            self._looks[key] = look = asyncio.ensure_future(run_in_threadpool(_look, self._database, watched, after))
            # Shared while it is under way, not kept: nobody reads the same again, and a failure must not stay.
            look.add_done_callback(lambda _: self._looks.pop(key, None))
        return await asyncio.shield(look)


def watched(kind: JobKind, job_id: str) -> Watched:
    """A job to watch: of a run the generations, of a diagnosis the steps."""

    def look(session: Session, after: int, limit: int) -> Told:
        past = store.steps(session, kind.step_table, job_id, after, limit)
        job = kind.view(store.one(session, kind.table, job_id))
        return Told(job, [checked(kind.step_answer, columns(one)) for one in past])

    return Watched(job_id, kind.step_event, look)


def described(step: str, example: str) -> dict[str, Any]:
    """A stream in the published description; the schema is that of one event."""
    data = {"type": "string", "contentMediaType": "application/json"}
    properties = {"id": {"type": "string"}, "event": {"enum": [step, "state"]}, "data": data}
    schema = {"type": "object", "properties": properties, "required": list(properties)}
    return {"content": {MEDIA_TYPE: {"schema": schema, "example": example}}}


def _look(database: Database, watched: Watched, after: int) -> Seen | None:
    try:
        with database.read() as session:
            told = watched.look(session, after, CHUNK)
    except (ProblemError, DatabaseClosedError):
        return None
    job, steps = told.job, told.steps
    last = steps[-1]["sequence"] if steps else after
    return Seen(
        steps=b"".join(_event(watched.step, step, step["sequence"]) for step in steps),
        after=last,
        complete=len(steps) < CHUNK,
        standing=(job["state"], job["pending_action"], job["error"]),
        # The id of a state is that of the last step sent before it: a reconnect then misses nothing.
        state=_event("state", job, last),
        final=State(job["state"]).final,
    )


def _event(kind: str, data: object, sequence: int) -> bytes:
    return b"id: %d\nevent: %b\ndata: %b\n\n" % (sequence, kind.encode(), to_json(data))
