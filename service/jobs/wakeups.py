"""Wakes whoever watches a run. Carries no data: the database says what changed, so nothing can be missed."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager


class Changes:
    """Threads publish, coroutines watch."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._watchers: dict[str, set[tuple[asyncio.AbstractEventLoop, asyncio.Event]]] = {}
        self.closed = False

    @contextmanager
    def watch(self, run_id: str) -> Iterator[asyncio.Event]:
        """An event that is set at every change of the run, at every change of keys, and when the service stops."""
        watcher = (asyncio.get_running_loop(), asyncio.Event())
        with self._lock:
            self._watchers.setdefault(run_id, set()).add(watcher)
        try:
            yield watcher[1]
        finally:
            with self._lock:
                watchers = self._watchers[run_id]
                watchers.discard(watcher)
                if not watchers:
                    del self._watchers[run_id]

    @property
    def watchers(self) -> int:
        """How many watch."""
        with self._lock:
            return sum(len(group) for group in self._watchers.values())

    def publish(self, run_id: str) -> None:
        """The run changed."""
        with self._lock:
            watchers = list(self._watchers.get(run_id, ()))
        _wake(watchers)

    def close(self) -> None:
        """Let all watchers go, so that open streams do not hold up the end of the process."""
        self.closed = True
        self.wake_all()

    def wake_all(self) -> None:
        """Wake every watcher, whatever it watches."""
        with self._lock:
            watchers = [watcher for group in self._watchers.values() for watcher in group]
        _wake(watchers)


def _wake(watchers: list[tuple[asyncio.AbstractEventLoop, asyncio.Event]]) -> None:
    for loop in {loop for loop, _ in watchers}:
        if not loop.is_closed():
            # All at once: each call from another thread wakes the loop anew.
            loop.call_soon_threadsafe(_set, [event for one, event in watchers if one is loop])


def _set(events: list[asyncio.Event]) -> None:
    for event in events:
        event.set()
