"""The number of individuals that the kernels compute at a time, if the environment states it."""

from __future__ import annotations

import os

VARIABLE = "WINGFIT_LANES"  # sets the number, for tests: results do not depend on it
POSSIBLE = (2, 4, 8)


def requested_lanes() -> int | None:
    """Return the number in the environment, None if there is none; ValueError for another than POSSIBLE.

    The kernels need the number when they are imported; this module does not import them.
    """
    requested = os.environ.get(VARIABLE, "").strip()
    if requested and requested not in map(str, POSSIBLE):
        raise ValueError(f"{VARIABLE} is {requested!r}; it must be one of {', '.join(map(str, POSSIBLE))}, or unset")
    return int(requested) if requested else None
