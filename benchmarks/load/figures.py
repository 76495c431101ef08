"""Statistics of response times."""

from __future__ import annotations

import math
from collections.abc import Sequence


def percentile(values: Sequence[float], percent: float) -> float | None:
    """Smallest of ``values`` that at least ``percent`` per cent of them do not exceed; None if there are no values."""
    if not values:
        return None
    return sorted(values)[max(1, math.ceil(percent / 100 * len(values))) - 1]


def milliseconds(seconds: Sequence[float]) -> dict[str, float | None]:
    """Return median, 99th percentile and maximum, in ms, of times in ``seconds``; None each if there are none."""
    return {
        name: None if (found := percentile(seconds, percent)) is None else round(1e3 * found, 2)
        for name, percent in (("p50_ms", 50), ("p99_ms", 99), ("max_ms", 100))
    }
