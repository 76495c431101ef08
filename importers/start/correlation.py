"""How many rows of a smooth residual count as one independent row."""

from __future__ import annotations

import numpy as np

from wingfit.records.array_types import Array, Float

_LONGEST = 0.25  # of the rows: the largest distance at which a correlation is counted


def correlated_rows(left: Float[Array, "T C"]) -> float:
    """Return the count of neighbouring rows of the residual ``left`` that vary together, at least 1; NaN are gaps.

    A variance of a mean of T rows is that of T / count independent ones: the sum of the autocorrelation (averaged over
    the columns C) to its first zero, twice, less that of the row itself (Priestley 1981, section 5.3).
    """
    values = np.nan_to_num(left - np.nanmean(left, axis=0))
    power = float((values**2).sum())
    count = 1.0
    for step in range(1, int(_LONGEST * len(values)) + 1):
        shared = float((values[step:] * values[:-step]).sum())
        if not shared > 0:
            break
        count += 2 * shared / power
    return count
