"""Which places of a marker do not fit to those before and after."""

from __future__ import annotations

import numpy as np

from wingfit.records.array_types import Array, Float, Mask

_NEIGHBOURS, _DEGREE = 3, 4  # on each side; of the polynomial through them
_DEVIATIONS = 6.0
_MEDIAN = 1.538  # of the length of three standard normal numbers


def jumps(
    times: Float[Array, " T"], positions: Float[Array, "T K 3"], covariance: Float[Array, "T K 3 3"], least: float
) -> Mask:
    """Return where [T, K] a marker is far from a polynomial through its places at the nearest instants around it.

    Far is more than six times what the covariances explain, or than the marker is in the median: a polynomial cannot
    follow fast flexing. It is more than ``least`` (m), too: less is not the place of another marker.
    """
    count, markers = positions.shape[:2]
    apart = np.full((count, markers), np.nan)
    large = np.zeros((count, markers), dtype=bool)
    for marker in range(markers):
        known = np.flatnonzero(np.isfinite(positions[:, marker]).all(1))
        for place, instant in enumerate(known):
            near = np.r_[known[max(place - _NEIGHBOURS, 0) : place], known[place + 1 : place + 1 + _NEIGHBOURS]]
            # Beside a gap the polynomial spans more time than elsewhere, and follows the motion less well.
            if len(near) <= _DEGREE or np.abs(near - instant).max() > _NEIGHBOURS + 1:
                continue
            scale = np.abs(times[near] - times[instant]).max()
            design = ((times[near] - times[instant]) / scale)[:, None] ** np.arange(_DEGREE + 1)
            weights = np.linalg.pinv(design)[0]
            residual = positions[instant, marker] - weights @ positions[near, marker]
            spread = covariance[instant, marker] + np.einsum("n,nij->ij", weights**2, covariance[near, marker])
            apart[instant, marker] = np.sqrt(residual @ np.linalg.solve(spread, residual))
            large[instant, marker] = np.linalg.norm(residual) > least
    compared = np.isfinite(apart)
    typical = np.ones(markers)
    for one in np.flatnonzero(compared.any(0)):
        typical[one] = max(float(np.median(apart[compared[:, one], one])) / _MEDIAN, 1.0)
    return np.asarray(large & (np.nan_to_num(apart) > _DEVIATIONS * typical))
