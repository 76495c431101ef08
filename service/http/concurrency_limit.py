"""Lets a few requests in at a time that take time or memory; the others wait without a thread, and reading goes on."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from wingfit.service.http.problems import ProblemError

AT_ONCE = 4
# A dataset of the largest size takes some gigabytes while it is read.
UPLOADS_AT_ONCE = 2
# Each simulates every recording, which may take an hour, and is made in memory.
EXPORTS_AT_ONCE = 1
# Large answers, until the client has taken them: those that are read, and those that are simulated, of which each may
# take tens of megabytes of memory.
DOWNLOADS_AT_ONCE = ANSWERS_AT_ONCE = 8
# A copy of the whole database, on the disk until the client has taken it.
BACKUPS_AT_ONCE, BACKUPS_WAITING = 1, 2
MOST_WAITING = 64


class Turns:
    """``at_once`` may work, ``most_waiting`` may wait; who comes then is told to come later."""

    def __init__(self, what: str = "simulations", at_once: int = AT_ONCE, most_waiting: int = MOST_WAITING) -> None:
        self._what, self._free = what, asyncio.Semaphore(at_once)
        self._most, self._waiting = most_waiting, 0

    async def take(self) -> None:
        """Wait for a turn; a 503 where too many do."""
        if self._free.locked() and self._waiting >= self._most:
            raise ProblemError(
                503, "busy", f"{self._waiting} {self._what} wait already, the most that may; try again in some seconds"
            )
        self._waiting += 1
        try:
            await self._free.acquire()
        finally:
            self._waiting -= 1

    @asynccontextmanager
    async def turn(self) -> AsyncIterator[None]:
        """Within the block it is the caller's turn."""
        await self.take()
        try:
            yield
        finally:
            self.give_back()

    def give_back(self) -> None:
        """Let the next one in."""
        self._free.release()


class Place:
    """One turn of a request, taken when it is needed and given back at its end."""

    def __init__(self) -> None:
        self._turns: Turns | None = None

    async def take(self, turns: Turns) -> None:
        """Wait for a turn, once; a 503 where too many do."""
        await turns.take()
        self._turns = turns

    def give_back(self) -> None:
        """Let the next one in, if a turn was taken."""
        if self._turns is not None:
            self._turns.give_back()
            self._turns = None
