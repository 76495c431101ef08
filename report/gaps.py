"""Finds the gaps in the times of samples, so that no curve is drawn across them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from wingfit.records.array_types import Array

LONGEST_STEP = 1.9  # in medians of the steps: between the samples at the ends of a longer step, samples are missing


def starts_after_gaps(times: Sequence[float] | Array) -> list[int]:
    """Return the indices of the samples that follow a gap in the increasing ``times`` [N], in any unit."""
    steps = np.diff(np.asarray(times, dtype=float))
    if not len(steps):
        return []
    return [int(k) + 1 for k in np.flatnonzero(steps > LONGEST_STEP * np.median(steps))]


def pieces(times: Sequence[float] | Array) -> list[slice]:
    """Return the parts of ``times`` [N] between which samples are missing, in order; one if none is."""
    return [slice(start, end) for start, end in pairwise([0, *starts_after_gaps(times), len(times)])]
