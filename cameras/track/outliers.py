"""Which places of a marker do not fit to those before and after."""

from __future__ import annotations

from heapq import heapify, heappop, heappush

import numpy as np

from wingfit.records.array_types import Array, Float, Index, Mask

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
    far = np.zeros(positions.shape[:2], dtype=bool)
    for marker in range(positions.shape[1]):
        far[:, marker] = _Places(times, positions[:, marker], covariance[:, marker], least).far()
    return far


class _Places:
    """The places of one marker, of which some are left out."""

    def __init__(
        self, times: Float[Array, " T"], positions: Float[Array, "T 3"], covariance: Array, least: float
    ) -> None:
        self.times, self.positions, self.covariance, self.least = times, positions, covariance, least
        self.known: Mask = np.asarray(np.isfinite(positions).all(1))

    def far(self) -> Mask:
        """Return which places are far: the farthest first, as it also displaces the polynomials of its neighbours."""
        known = np.flatnonzero(self.known)
        apart, large = self._distances(known, np.arange(len(self.times)))
        compared = np.isfinite(apart)
        typical = max(float(np.median(apart[compared])) / _MEDIAN, 1.0) if compared.any() else 1.0
        limit = _DEVIATIONS * typical
        apart = np.where(large, np.nan_to_num(apart), 0.0)
        far = np.zeros(len(apart), dtype=bool)
        # The farthest first, then the first; what has changed since it was added is passed over.
        queue = [(-apart[one], int(one)) for one in np.flatnonzero(apart > limit)]
        heapify(queue)
        while queue:
            negative, worst = heappop(queue)
            if far[worst] or -negative != apart[worst]:
                continue
            far[worst], self.known[worst] = True, False
            place = int(np.searchsorted(known, worst))
            known = np.delete(known, place)
            again = np.r_[worst, known[max(place - _NEIGHBOURS, 0) : place + _NEIGHBOURS]]
            now, still = self._distances(known, again)
            apart[again] = np.where(still, np.nan_to_num(now), 0.0)
            for one in again[apart[again] > limit]:
                heappush(queue, (-apart[one], int(one)))
        return far

    def _distances(self, known: Index, instants: Index) -> tuple[Float[Array, " N"], Mask]:
        """Return the distances at ``instants`` from the polynomials, in standard deviations, and which are large.

        NaN where a place is unknown, or has too few neighbours among the ``known`` ones.
        """
        apart, large = np.full(len(instants), np.nan), np.zeros(len(instants), dtype=bool)
        for row, instant in enumerate(instants):
            place = int(np.searchsorted(known, instant))
            near = np.r_[known[max(place - _NEIGHBOURS, 0) : place], known[place + 1 : place + 1 + _NEIGHBOURS]]
            # Beside a gap the polynomial spans more time than elsewhere, and follows the motion less well.
            alone = len(near) <= _DEGREE or np.abs(near - instant).max() > _NEIGHBOURS + 1
            if not self.known[instant] or alone:
                continue
            scale = np.abs(self.times[near] - self.times[instant]).max()
            design = ((self.times[near] - self.times[instant]) / scale)[:, None] ** np.arange(_DEGREE + 1)
            weights = np.linalg.pinv(design)[0]
            residual = self.positions[instant] - weights @ self.positions[near]
            spread = self.covariance[instant] + np.einsum("n,nij->ij", weights**2, self.covariance[near])
            apart[row] = np.sqrt(residual @ np.linalg.solve(spread, residual))
            large[row] = np.linalg.norm(residual) > self.least
        return apart, large
