"""Limits how many requests that take much time or memory run at a time. Waiting requests hold no worker thread."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from wingfit.service.http.problems import ProblemError

SIMULATIONS = 4
# Reading a dataset of the largest size takes some gigabytes.
UPLOADS = 2
# Videos of gigabytes, written to the disk as they arrive; frames, each decoded in a process.
FILM_UPLOADS, FRAMES = 8, 4
# An export simulates every recording, which may take an hour, and is made in memory.
EXPORTS = 1
# A plan of a wing with all effects takes minutes, which as many more users would wait.
PLANS, MAX_WAITING_PLANS = 1, 8
# Large answers, held until the client has taken them: stored ones, and simulated ones of some tens of megabytes.
DOWNLOADS = ANSWERS = 8
# A copy of the whole database, which is on the disk until the client has taken it.
BACKUPS, MAX_WAITING_BACKUPS = 1, 2
MAX_WAITING = 64


class ConcurrencyLimit:
    """Limit for one kind of request, which messages call ``what``.

    At most ``limit`` of them run and ``max_waiting`` wait; further ones are answered with a 503.
    """

    def __init__(self, what: str, limit: int, max_waiting: int = MAX_WAITING) -> None:
        self._what, self._free = what, asyncio.Semaphore(limit)
        self._max_waiting, self._waiting = max_waiting, 0

    @asynccontextmanager
    async def slot(self) -> AsyncIterator[None]:
        """Wait until fewer than ``limit`` requests run, and count as running within the block; 503 if too many wait."""
        if self._free.locked() and self._waiting >= self._max_waiting:
            detail = f"{self._waiting} {self._what} are waiting, the maximum; try again in some seconds"
            raise ProblemError(503, "busy", detail)
        self._waiting += 1
        try:
            await self._free.acquire()
        finally:
            self._waiting -= 1
        try:
            yield
        finally:
            self._free.release()
