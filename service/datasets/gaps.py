"""Missing samples of a recording, counted and located."""

from __future__ import annotations

import numpy as np

from wingfit.client.recorded.answers import Gap, Missing
from wingfit.records.array_types import Array

MOST_GAPS = 200  # that are listed by channel
TIME_DECIMALS = 6


def missing(values: Array, times: Array) -> Missing:
    """Return how many ``values`` [T] are not finite, and the first MOST_GAPS runs of them; ``times`` [T] in s."""
    lost = ~np.isfinite(values)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], lost, [False]]).astype(int)))
    at = np.round(times, TIME_DECIMALS).tolist()
    runs: list[list[int]] = edges.reshape(-1, 2)[:MOST_GAPS].tolist()
    gaps: list[Gap] = [{"from_s": at[first], "to_s": at[end - 1], "samples": end - first} for first, end in runs]
    return {"samples": int(lost.sum()), "gaps": gaps}
