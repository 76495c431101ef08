"""Whether local estimates of a coefficient, one for each condition, differ by more than their errors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from wingfit.calibration.forces.result import LocalEstimate

BY_CHANCE = 0.01  # probability of a larger Q among equal coefficients, below which estimates disagree


def disagreements(estimates: Sequence[LocalEstimate]) -> dict[str, float]:
    """Return the standard deviation between the ``estimates`` of each gene that differ by more than their errors.

    They do if Cochran's Q (1954), the sum of squares of their differences from their weighted mean in standard errors,
    is larger than equal coefficients make it with the probability BY_CHANCE: then the coefficient depends on the
    condition, or absorbs physics that the model misses. Estimates without a finite error are not compared.
    """
    found = {}
    for name in dict.fromkeys(name for one in estimates for name in one.values):
        values, errors = _known(estimates, name)
        if len(values) < 2:
            continue
        mean = np.average(values, weights=errors**-2.0)
        spread = float(np.sum(((values - mean) / errors) ** 2))
        if scipy.stats.chi2.sf(spread, len(values) - 1) < BY_CHANCE:
            found[name] = float(np.std(values, ddof=1))
    return found


def disagreement_remarks(estimates: Sequence[LocalEstimate]) -> tuple[str, ...]:
    """Return a remark on each gene whose ``estimates`` disagree, with their range and their largest standard error."""
    remarks = []
    for name, deviation in disagreements(estimates).items():
        values, errors = _known(estimates, name)
        remarks.append(
            f"the {len(values)} local estimates of {name} disagree: {values.min():.3g} to {values.max():.3g}, standard "
            f"deviation {deviation:.2g}, where the largest standard error is {errors.max():.2g}: the coefficient "
            "depends on the condition, or absorbs physics that the model misses: use each estimate under its own "
            "condition, or a global model, and not their mean"
        )
    return tuple(remarks)


def _known(estimates: Sequence[LocalEstimate], name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return values and standard errors of the estimates of the gene ``name`` whose error is finite and not zero."""
    pairs = [(one.values[name], one.standard_errors.get(name, np.inf)) for one in estimates if name in one.values]
    known = np.array([pair for pair in pairs if 0.0 < pair[1] < np.inf]).reshape(-1, 2)
    return known[:, 0], known[:, 1]
