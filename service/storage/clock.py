"""The service clock, which measures how long ago jobs ended.

A wall clock may be wrong and may jump by years: a dead battery, a restored virtual machine, a date set by hand. Data
deleted by a wrong clock are lost. Therefore the service counts seconds itself: by the monotonic clock while a process
runs, and by the wall clock between two processes, at most one day each time.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from wingfit.service.storage import store
from wingfit.service.storage.tables import ClockRow

LOG = logging.getLogger("wingfit")
DAY = 86_400.0
ROW = 1  # the only one


def _wall() -> datetime:
    return datetime.now(UTC)


def _steady() -> float:
    """Return the seconds of a monotonic clock: where possible one that also counts while the computer is suspended."""
    boot = getattr(time, "CLOCK_BOOTTIME", None)
    return time.monotonic() if boot is None else time.clock_gettime(boot)


class ServiceClock:
    """Clock that counts the seconds for which the service has run, over all its processes; never decreases.

    It is never ahead of true time, except that each start of a process may add up to one day too much if the wall clock
    jumped ahead. ``wall``, ``steady``: functions that return the wall time (UTC), and seconds of a monotonic clock.
    """

    def __init__(self, wall: Callable[[], datetime] = _wall, steady: Callable[[], float] = _steady) -> None:
        self._wall, self._steady = wall, steady
        self._last: tuple[datetime, float] | None = None

    def advance(self, session: Session) -> float:
        """Advance the clock to the present time, store its reading in the database, and return it (s)."""
        wall, steady = self._wall(), self._steady()
        row = session.get(ClockRow, ROW)
        if row is None:
            row = ClockRow(id=ROW, service_seconds=0.0)
            session.add(row)
        elif self._last is None:
            row.service_seconds += _stopped(row.wall_time, wall)
        else:
            row.service_seconds += _elapsed(self._last, (wall, steady))
        row.wall_time = store.timestamp(wall)
        self._last = wall, steady
        return row.service_seconds


def _elapsed(before: tuple[datetime, float], now: tuple[datetime, float]) -> float:
    """Return the seconds between two moments of one process, by the monotonic clock; log a jump of the wall clock.

    ``before`` and ``now``: (wall time, seconds of the monotonic clock).
    """
    elapsed = max(now[1] - before[1], 0.0)
    jumped = (now[0] - before[0]).total_seconds() - elapsed
    if abs(jumped) > DAY:
        LOG.warning(
            "the wall clock jumped by %+.1f days within %.1f hours; WINGFIT_KEEP_DAYS counts the hours only",
            jumped / DAY,
            elapsed / 3600,
        )
    return elapsed


def _stopped(stored: str, wall: datetime) -> float:
    """Return the seconds for which no process ran, from ``stored`` to ``wall``, limited to [0, 1 day].

    ``stored``: wall time (RFC 3339) that an earlier process stored last; an unreadable one gives 0.
    """
    try:
        gap = (wall - datetime.fromisoformat(stored)).total_seconds()
    except (TypeError, ValueError):  # no time, or one without a zone
        return 0.0
    counted = min(max(gap, 0.0), DAY)
    if abs(gap - counted) > DAY:
        LOG.warning(
            "by the wall clock the service last ran %.1f days ago; WINGFIT_KEEP_DAYS counts %.0f of them",
            gap / DAY,
            counted / DAY,
        )
    return counted
