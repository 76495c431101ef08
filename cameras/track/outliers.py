"""Which places of a marker do not fit to those before and after."""

from __future__ import annotations

import numpy as np

from wingfit.records.array_types import Array, Float, Index, Mask

_NEIGHBOURS, _DEGREE = 3, 4  # on each side; of the polynomial through them
_DEVIATIONS = 6.0


def jumps(times: Float[Array, " T"], positions: Float[Array, "T K 3"], covariance: Float[Array, "T K 3 3"]) -> Mask:
    """Return where [T, K] a marker is far from a polynomial through its places at the nearest instants around it.

    Far is more than six times what the covariances and the scatter about the polynomials explain.
    """
    places = [_Places(times, positions[:, marker], covariance[:, marker]) for marker in range(positions.shape[1])]
    apart = np.stack([of.distances(np.arange(len(times))) for of in places], axis=1)
    typical = max(float(np.nanmedian(apart)) / 1.538, 1.0) if np.isfinite(apart).any() else 1.0
    return np.stack([of.without_far(apart[:, k], _DEVIATIONS * typical) for k, of in enumerate(places)], axis=1)


class _Places:
    """The places of one marker, of which some are left out."""

    def __init__(self, times: Float[Array, " T"], positions: Float[Array, "T 3"], covariance: Array) -> None:
        self.times, self.positions, self.covariance = times, positions, covariance
        self.known: Mask = np.asarray(np.isfinite(positions).all(1))

    def distances(self, instants: Index) -> Float[Array, " N"]:
        """Return the distances at ``instants`` from the polynomials, in standard deviations; NaN where unknown."""
        apart = np.full(len(instants), np.nan)
        known = np.flatnonzero(self.known)
        for row, instant in enumerate(instants):
            place = int(np.searchsorted(known, instant))
            if not self.known[instant]:
                continue
            near = np.r_[known[max(place - _NEIGHBOURS, 0) : place], known[place + 1 : place + 1 + _NEIGHBOURS]]
            if len(near) <= _DEGREE:
                continue
            scale = np.abs(self.times[near] - self.times[instant]).max()
            design = ((self.times[near] - self.times[instant]) / scale)[:, None] ** np.arange(_DEGREE + 1)
            weights = np.linalg.pinv(design)[0]
            residual = self.positions[instant] - weights @ self.positions[near]
            spread = self.covariance[instant] + np.einsum("n,nij->ij", weights**2, self.covariance[near])
            apart[row] = np.sqrt(residual @ np.linalg.solve(spread, residual))
        return apart

    def without_far(self, apart: Float[Array, " T"], most: float) -> Mask:
        """Return which places are farther than ``most``: the farthest first, as it also displaces its neighbours."""
        far = np.zeros(len(apart), dtype=bool)
        apart = np.nan_to_num(apart)
        while apart.max(initial=0.0) > most:
            worst = int(apart.argmax())
            far[worst], self.known[worst] = True, False
            known = np.flatnonzero(self.known)
            place = int(np.searchsorted(known, worst))
            again = np.r_[worst, known[max(place - _NEIGHBOURS, 0) : place + _NEIGHBOURS]]
            apart[again] = np.nan_to_num(self.distances(again))
        return far
