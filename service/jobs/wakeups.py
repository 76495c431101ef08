"""Wakes the event streams of a job when the job changes.

A notification contains no data: the woken streams read the database, so a missed notification loses nothing.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager


class Changes:
    """Notifies coroutines of changed jobs: threads call :meth:`publish`, coroutines wait in :meth:`watch`.

    ``closed``: whether the service stops, so that streams must end.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._watchers: dict[str, set[tuple[asyncio.AbstractEventLoop, asyncio.Event]]] = {}
        self.closed = False

    @contextmanager
    def watch(self, job_id: str) -> Iterator[asyncio.Event]:
        """Yield an event that is set whenever the job or the API keys change, and when the service stops."""
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
        """Number of coroutines that wait for changes, over all jobs."""
        with self._lock:
            return sum(len(group) for group in self._watchers.values())

    def publish(self, job_id: str) -> None:
        """Wake the coroutines that wait for changes of this job."""
        with self._lock:
            watchers = list(self._watchers.get(job_id, ()))
        _wake(watchers)

    def close(self) -> None:
        """Wake all waiting coroutines for good, so that open event streams do not delay the end of the process."""
        self.closed = True
        self.wake_all()

    def wake_all(self) -> None:
        """Wake the waiting coroutines of all jobs."""
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
