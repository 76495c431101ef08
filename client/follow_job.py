"""Follows a job by its server-sent events until it ends, reconnecting if the connection is lost."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar, cast

from wingfit.client import answers as a
from wingfit.client.diagnosis_answers import Diagnosis
from wingfit.client.films.answers import Tracking
from wingfit.client.transport import ServerAwayError, Transport, WingfitError, is_passing

JobT = TypeVar("JobT", a.Run, Diagnosis, Tracking)

# Event that reports a finished step: the field of a job that counts such steps.
COUNTS = {"generation": "generations", "step": "steps"}
UPDATED = ("stage", "progress", "eta_seconds", "best_mm", "best_mn", "best_percent", "evaluations")


class Watching(Transport):
    """Base class of the client: follows jobs, given by their URL paths, e.g. ``/v1/runs/ID``."""

    def _events(self, path: str, last_event_id: str | None, patience_s: float) -> Iterator[a.Event]:
        """Yield the events after ``last_event_id`` (None: all) of the job at ``path`` until the job has ended.

        A broken connection is resumed; ServerAwayError is raised if no server answers for ``patience_s`` seconds.
        """
        away_since: float | None = None
        while True:
            try:
                for event in self._events_once(f"{path}/events", last_event_id):
                    away_since = None
                    last_event_id = event["id"] or last_event_id
                    yield event
                    if _is_final(event):
                        return
                job = self._json("GET", path)  # the stream ended early, or resumed after the final state
                if job["state"] in a.FINAL:
                    yield {"id": None, "event": "state", "data": job}
                    return
            except WingfitError as error:
                if not is_passing(error):
                    raise
                away_since = away_since or time.monotonic()
                if time.monotonic() - away_since > patience_s:
                    raise ServerAwayError(self.base_url, error) from error
            time.sleep(self.retry_wait_s)

    def _wait(self, path: str, on_progress: Callable[[JobT], None] | None, patience_s: float) -> JobT:
        """Wait until the job at ``path`` has ended, and return it; call ``on_progress(job)`` after each change."""
        job: JobT = self._json("GET", path)
        report = on_progress or (lambda _: None)
        report(job)
        if job["state"] in a.FINAL:
            return job
        for event in self._events(path, None, patience_s):
            job = merge(job, event)
            report(job)
        return job


def merge(job: JobT, event: a.Event) -> JobT:
    """Return ``job`` with its fields updated by the server-sent ``event``; unchanged if the event is not new."""
    data = event["data"]
    if event["event"] == "state":
        return cast(JobT, dict(job) | data)
    count = COUNTS.get(event["event"])
    now: Mapping[str, Any] = job
    # After a reconnection the server repeats steps that the job counts already.
    if count is None or data["sequence"] <= now[count]:
        return job
    known = {key: data[key] for key in UPDATED if key in data}
    return cast(JobT, dict(job) | known | {count: data["sequence"]})


def _is_final(event: a.Event) -> bool:
    return event["event"] == "state" and event["data"].get("state") in a.FINAL
