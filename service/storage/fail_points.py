"""Places in the code where tests can kill the process: WINGFIT_FAIL_POINT=committed:17 kills it after the 17th commit.

If the variable is not set, passing such a place costs one comparison.
"""

from __future__ import annotations

import os
import signal
from itertools import count
from typing import Literal

Place = Literal["commit", "committed", "answer"]
VARIABLE = "WINGFIT_FAIL_POINT"


PLACE, _, COUNT = os.environ.get(VARIABLE, "").partition(":")
_LEFT = count(int(COUNT or 1) - 1, -1)  # passes that are still survived; next() is atomic


def passing(place: Place) -> None:
    """Count a pass of ``place``; kill the process if WINGFIT_FAIL_POINT names this place and this number of passes."""
    if place == PLACE and next(_LEFT) <= 0:
        os.kill(os.getpid(), signal.SIGKILL)
