"""Server-sent events of a run, read from the database, so that a reconnect and a first look are one thing."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass

from pydantic import BaseModel
from starlette.concurrency import run_in_threadpool

from service import store, views
from service.changes import Changes
from service.database import Database, DatabaseClosedError
from service.problems import ProblemError
from service.schemas import GenerationEvent, RunOut
from workers.jobs import State

HEARTBEAT_SECONDS = 15.0
CHUNK = 500


@dataclass(frozen=True)
class _Snapshot:
    run: RunOut
    generations: list[GenerationEvent]

    @property
    def complete(self) -> bool:
        """Whether nothing was left out."""
        return len(self.generations) < CHUNK


async def stream(database: Database, changes: Changes, run_id: str, after: int) -> AsyncIterator[bytes]:
    """Events after sequence ``after``, until the final state is sent or the service stops."""
    sent: tuple[object, ...] | None = None
    with changes.watch(run_id) as changed:
        while True:
            changed.clear()
            snapshot = await run_in_threadpool(_snapshot, database, run_id, after)
            if snapshot is None:
                return
            for generation in snapshot.generations:
                after = generation.sequence
                yield _event("generation", generation, after)
            if not snapshot.complete:
                continue
            if sent != _standing(snapshot.run):
                sent = _standing(snapshot.run)
                yield _event("state", snapshot.run, after)
            if State(snapshot.run.state).final or changes.closed:
                return
            try:
                await asyncio.wait_for(changed.wait(), HEARTBEAT_SECONDS)
            except TimeoutError:
                yield b": alive\n\n"


def _snapshot(database: Database, run_id: str, after: int) -> _Snapshot | None:
    try:
        with database.read() as session:
            run = views.run(store.run(session, run_id))
            rows = store.history(session, run_id, after, CHUNK)
    except (ProblemError, DatabaseClosedError):
        return None
    return _Snapshot(run, [views.generation_event(row) for row in rows])


def _standing(run: RunOut) -> tuple[object, ...]:
    return run.state, run.wish, run.error


def _event(kind: str, data: BaseModel, sequence: int) -> bytes:
    # The id of a state is that of the last generation sent before it: a reconnect then misses nothing.
    return f"id: {sequence}\nevent: {kind}\ndata: {data.model_dump_json()}\n\n".encode()
