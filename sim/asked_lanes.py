"""How many individuals the environment asks the kernels to compute at a time."""

from __future__ import annotations

import os

VARIABLE = "WINGFIT_LANES"  # sets the number, for tests: results do not depend on it
POSSIBLE = (2, 4, 8)


def asked_lanes() -> int | None:
    """Return the number in the environment, None if there is none; ValueError for another than POSSIBLE.

    The kernels need the number when they are imported; this module does not import them.
    """
    asked = os.environ.get(VARIABLE, "").strip()
    if asked and asked not in map(str, POSSIBLE):
        raise ValueError(f"{VARIABLE} is {asked!r}; it must be one of {', '.join(map(str, POSSIBLE))}, or unset")
    return int(asked) if asked else None
