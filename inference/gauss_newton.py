"""The damped Gauss-Newton step inside the unit box, tried with several dampings at once.

The cost is 1/2 |r|^2 of whitened residuals r, linearised as r + S d. A step d minimises slope . d + d . C d / 2 with
the curvature C = S^T S plus a damping, inside the box: an active-set bounded least-squares problem. Dampings in
proportion to each gene's curvature (Marquardt 1963) and equal ones (Levenberg 1944) are both of this form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from wingfit.records.array_types import Array, Float


@dataclass(frozen=True)
class Quadratic:
    """A cost near a point, slope . d + d . curvature d / 2, with ``curvature`` [F, F] and ``slope`` [F]."""

    curvature: Float[Array, "F F"]
    slope: Float[Array, " F"]

    @classmethod
    def of(cls, whitened: Sequence[tuple[Array, Array]]) -> Quadratic:
        """Half the sum of squares; ``whitened`` has (residual [N], sensitivities [N, F]) of each recording."""
        return cls(
            np.asarray(sum(steep.T @ steep for _, steep in whitened), float),
            np.asarray(sum(steep.T @ white for white, steep in whitened), float),
        )

    def step(
        self, unit: Float[Array, " F"], damping: Float[Array, " F"], slope: Float[Array, " F"] | None = None
    ) -> Float[Array, " F"]:
        """Step [F] from ``unit`` [F] that minimises the cost inside the box, ``damping`` [F] added to the curvatures.

        ``slope`` [F] replaces the quadratic's own.
        """
        factor = np.linalg.cholesky(self.curvature + np.diag(damping))
        aim = -np.linalg.solve(factor, self.slope if slope is None else slope)
        return np.asarray(scipy.optimize.lsq_linear(factor.T, aim, (-unit, 1.0 - unit), method="bvls").x)

    def decrease(self, steps: Float[Array, "S F"]) -> Float[Array, " S"]:
        """Decrease [S] of the cost that the quadratic predicts for ``steps`` [S, F]."""
        return np.asarray(-(steps @ self.slope) - 0.5 * np.einsum("dp,pq,dq->d", steps, self.curvature, steps))


@dataclass(frozen=True)
class Trials:
    """Points [S, F] reached with one damping each, with the predicted and the actual decrease of the cost.

    ``decrease`` is -inf for a point that cannot be simulated.
    """

    units: Float[Array, "S F"]
    predicted: Float[Array, " S"]
    decrease: Float[Array, " S"]

    @classmethod
    def of(cls, units: Array, predicted: Array, before: float, after: Array, reasons: Sequence[str | None]) -> Trials:
        """Trials at ``units`` [S, F] with costs ``before`` and ``after`` [S] the step; ``reasons`` say which failed."""
        failed = np.array([reason is not None for reason in reasons], bool)
        return cls(units, predicted, before - np.where(failed, np.inf, after))

    def best(self, least_gain: float = 0.0) -> int | None:
        """Index of the point with the largest decrease of the cost; None where no point qualifies.

        Its decrease must exceed ``least_gain`` times the predicted one, and the predicted one must be positive: at a
        bound, a step may be round-off alone.
        """
        good = (self.predicted > 0.0) & (self.decrease > least_gain * self.predicted)
        return int(np.argmax(np.where(good, self.decrease, -np.inf))) if good.any() else None

    def gain(self, k: int) -> float:
        """Actual decrease of the cost at point ``k``, divided by the predicted one."""
        return float(self.decrease[k] / self.predicted[k])
