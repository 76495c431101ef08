"""Points at which tests can kill the process: WINGFIT_FAIL_POINT=committed:17 kills it after the 17th commit.

Without the variable a point costs one comparison.
"""

from __future__ import annotations

import os
import signal
import threading
from typing import Literal

Place = Literal["commit", "committed", "answer"]
VARIABLE = "WINGFIT_FAIL_POINT"


class _Armed:
    def __init__(self, text: str) -> None:
        self.place, _, count = text.partition(":")
        self._left, self._lock = int(count), threading.Lock()

    def passing(self) -> None:
        with self._lock:
            self._left -= 1
            due = self._left <= 0
        if due:
            os.kill(os.getpid(), signal.SIGKILL)


_ARMED = _Armed(os.environ[VARIABLE]) if os.environ.get(VARIABLE) else None


def passing(place: Place) -> None:
    """Kill the process if WINGFIT_FAIL_POINT names this point."""
    if _ARMED is not None and _ARMED.place == place:
        _ARMED.passing()
