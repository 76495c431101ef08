"""Wakes event streams when a job changes. Carries no data: watchers read the database, so they miss nothing."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager


class Changes:
    """Notifications of changed jobs: threads call :meth:`publish`, coroutines wait in :meth:`watch`."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._watchers: dict[str, set[tuple[asyncio.AbstractEventLoop, asyncio.Event]]] = {}
        self.closed = False

    @contextmanager
    def watch(self, job_id: str) -> Iterator[asyncio.Event]:
        """An event that is set when the job or the API keys change, and when the service stops."""
        watcher = (asyncio.get_running_loop(), asyncio.Event())
        with self._lock:
            self._watchers.setdefault(job_id, set()).add(watcher)
        try:
            yield watcher[1]
        finally:
            with self._lock:
                watchers = self._watchers[job_id]
                watchers.discard(watcher)
                if not watchers:
                    del self._watchers[job_id]

    @property
    def watchers(self) -> int:
        """Number of watchers."""
        with self._lock:
            return sum(len(group) for group in self._watchers.values())

    def publish(self, job_id: str) -> None:
        """Wake the watchers of a job that has changed."""
        with self._lock:
            watchers = list(self._watchers.get(job_id, ()))
        _wake(watchers)

    def close(self) -> None:
        """End all watchers, so that open streams do not delay the end of the process."""
        self.closed = True
        self.wake_all()

    def wake_all(self) -> None:
        """Wake all watchers."""
        with self._lock:
            watchers = [watcher for group in self._watchers.values() for watcher in group]
        _wake(watchers)


def _wake(watchers: list[tuple[asyncio.AbstractEventLoop, asyncio.Event]]) -> None:
    for loop in {loop for loop, _ in watchers}:
        if not loop.is_closed():
            # In one call: each call from another thread wakes the loop again.
            loop.call_soon_threadsafe(_set, [event for one, event in watchers if one is loop])


def _set(events: list[asyncio.Event]) -> None:
    for event in events:
        event.set()
