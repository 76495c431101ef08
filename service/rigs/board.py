"""Simulations that jobs wait for, and the drivers that compute them.

A driver is a process of the user's that takes simulations, and returns their results over HTTP. Any number of drivers
may serve a job; they may come and go. A simulation that a driver has taken is offered again once that driver has been
silent for SILENT_SECONDS, or has not settled it within OVERDUE_SECONDS.
"""

from __future__ import annotations

import hashlib
import json
import threading
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from wingfit.client.drive_answers import Simulation
from wingfit.rigs.rig_model import Simulated
from wingfit.service.jobs.wakeups import Changes

SILENT_SECONDS = 60.0  # after which a driver counts as gone
OVERDUE_SECONDS = 600.0  # after which a simulation is offered to a second driver, too
POLL_SECONDS = 0.2


@dataclass(frozen=True)
class Call:
    """One simulation: values of the ``genes`` by name, ``effects`` that are added, and the name of the recording.

    ``settings``: those that differ from the recording's; ``input_factors``: of inputs that are scaled.
    """

    recording: str
    effects: tuple[str, ...]
    genes: Mapping[str, float]
    settings: Mapping[str, float] = field(default_factory=dict)
    input_factors: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def key(self) -> str:
        """Hash of the contents; equal calls have equal keys, on any server."""
        changes = [sorted(self.settings.items()), sorted(self.input_factors.items())]
        text = json.dumps([self.recording, self.effects, list(self.genes.items()), *changes])
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    def simulation(self) -> Simulation:
        """Return the call as a driver receives it."""
        return {
            "id": self.key,
            "recording": self.recording,
            "effects": list(self.effects),
            "genes": dict(self.genes),
            "settings": dict(self.settings),
            "input_factors": dict(self.input_factors),
        }


class DriverError(ValueError):
    """Raised where the simulation of a driver has an error that is not a failure of one individual."""


@dataclass
class _Open:
    """A call without a result; ``driver`` took it at the time ``since``."""

    call: Call
    driver: str | None = None
    since: float = 0.0


@dataclass
class _Desk:
    """What one job waits for, by key, what was computed for it, and when each of its drivers was last heard of.

    ``given``: calls that drivers took and have not settled, also those for which the job no longer waits: it may have
    gone back to the queue because a driver was silent while it computed. ``error``: why a driver gave up.
    """

    open: dict[str, _Open] = field(default_factory=dict)
    done: dict[str, Simulated] = field(default_factory=dict)
    heard: dict[str, float] = field(default_factory=dict)
    given: dict[str, Call] = field(default_factory=dict)
    error: str | None = None


class Board:
    """The open simulations of all jobs; threads of jobs put them up, requests of drivers take and settle them.

    ``clock`` returns seconds. ``changes`` wakes the requests that wait for simulations of a job.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._changed = clock, threading.Condition()
        self._desks: dict[str, _Desk] = {}
        self.changes = Changes()

    def attended(self, job_id: str) -> bool:
        """Return whether a driver of the job was heard of within SILENT_SECONDS."""
        with self._changed:
            desk = self._desks.get(job_id)
            return desk is not None and any(self._present(desk, driver) for driver in desk.heard)

    def put(self, job_id: str, calls: Sequence[Call]) -> None:
        """Put up ``calls`` of a job."""
        with self._changed:
            desk = self._desk(job_id)
            for call in calls:
                desk.open.setdefault(call.key, _Open(call))
        self.changes.publish(job_id)

    def results(self, job_id: str, keys: Sequence[str]) -> dict[str, Simulated] | None:
        """Return the results of ``keys``, or None if some are missing after a wait of POLL_SECONDS.

        Raises DriverError if a driver gave up.
        """
        with self._changed:
            desk = self._desk(job_id)
            complete = self._changed.wait_for(
                lambda: desk.error is not None or all(key in desk.done for key in keys), POLL_SECONDS
            )
            if desk.error is not None:
                raise DriverError(f"the simulation has an error where it is driven: {desk.error}")
            return {key: desk.done[key] for key in keys} if complete else None

    def withdraw(self, job_id: str, keys: Sequence[str]) -> None:
        """Remove calls for which the job no longer waits, and their results."""
        with self._changed:
            if desk := self._desks.get(job_id):
                for key in keys:
                    desk.open.pop(key, None)
                    desk.done.pop(key, None)

    def take(self, job_id: str, driver: str, limit: int, holding: Collection[str] = ()) -> list[Call]:
        """Give up to ``limit`` calls of the job to ``driver``, which computes those with the keys ``holding`` already.

        What it took and does not hold got lost on the way, and is free again.
        """
        with self._changed:
            desk, now = self._desk(job_id), self._clock()
            desk.heard = {name: at for name, at in desk.heard.items() if now - at < SILENT_SECONDS} | {driver: now}
            for key in holding:
                if key in desk.open and self._free(desk, desk.open[key], driver):
                    self._give(desk, desk.open[key], driver)
            free = [
                one
                for key, one in desk.open.items()
                if key not in desk.done and key not in holding and self._free(desk, one, driver)
            ]
            return [self._give(desk, one, driver) for one in free[:limit]]

    def given_call(self, job_id: str, key: str) -> Call | None:
        """Return the call with this ``key`` that a driver took; None if there is none, or it has a result."""
        with self._changed:
            desk = self._desks.get(job_id)
            return desk.given.get(key) if desk else None

    def settle(self, job_id: str, driver: str, results: Mapping[str, Simulated]) -> None:
        """Store the ``results`` of calls by key; those for which the job does not wait are dropped."""
        with self._changed:
            desk = self._desk(job_id)
            desk.heard[driver] = self._clock()
            for key, result in results.items():
                desk.given.pop(key, None)
                if key in desk.open:
                    desk.done.setdefault(key, result)
            self._changed.notify_all()

    def give_up(self, job_id: str, error: str) -> None:
        """Let the job fail, because its simulation has an ``error``."""
        with self._changed:
            self._desk(job_id).error = error
            self._changed.notify_all()

    def release(self, job_id: str, driver: str) -> None:
        """Offer what ``driver`` has taken to others, because it leaves."""
        with self._changed:
            if desk := self._desks.get(job_id):
                desk.heard.pop(driver, None)
        self.changes.publish(job_id)

    def clear(self, job_id: str) -> None:
        """Drop what is open for a job that no longer runs; drivers may still return what they took."""
        with self._changed:
            if job_id in self._desks:
                self._desks[job_id] = _Desk(given=self._desks[job_id].given)
        self.changes.publish(job_id)

    def forget(self, job_id: str) -> None:
        """Drop all that is known of a job that has ended, and wake its drivers."""
        with self._changed:
            self._desks.pop(job_id, None)
        self.changes.publish(job_id)

    def _desk(self, job_id: str) -> _Desk:
        return self._desks.setdefault(job_id, _Desk())

    def _give(self, desk: _Desk, one: _Open, driver: str) -> Call:
        if one.driver != driver:
            one.driver, one.since = driver, self._clock()
        desk.given[one.call.key] = one.call
        return one.call

    def _free(self, desk: _Desk, one: _Open, driver: str) -> bool:
        overdue = self._clock() - one.since > OVERDUE_SECONDS
        return one.driver in (None, driver) or overdue or not self._present(desk, one.driver)

    def _present(self, desk: _Desk, driver: str | None) -> bool:
        return driver in desk.heard and self._clock() - desk.heard[driver] < SILENT_SECONDS
