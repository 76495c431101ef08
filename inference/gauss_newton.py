"""Damped Gauss-Newton steps that stay within the bounds of the genes, tried with several dampings at once.

Genes are scaled so that their bounds are 0 and 1 (the unit box). The cost is |r|^2 / 2, with whitened residuals r
(scaled to unit noise covariance). A step d changes them to about r + S d with the sensitivities S = dr / d(genes). The
best step minimises slope . d + d . C d / 2 within the box: the slope is S^T r, the curvature C is S^T S plus a diagonal
damping. This bounded linear least-squares problem is solved by an active-set method. Damping in proportion to the
diagonal of S^T S is that of Marquardt (1963); equal damping of all genes is that of Levenberg (1944).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from wingfit.records.array_types import Array, Float


@dataclass(frozen=True)
class Quadratic:
    """Second-order model of a cost near a point: a step d [F] changes the cost by slope . d + d . curvature d / 2.

    ``slope`` [F]: gradient with respect to F genes; ``curvature`` [F, F]: Gauss-Newton approximation of the Hessian.
    """

    curvature: Float[Array, "F F"]
    slope: Float[Array, " F"]

    @classmethod
    def of(cls, whitened: Sequence[tuple[Array, Array]]) -> Quadratic:
        """Build the model of half the sum of squares of whitened residuals.

        ``whitened`` holds, for each recording, (residuals [N], their derivatives [N, F] with respect to F genes).
        """
        return cls(
            np.asarray(sum(steep.T @ steep for _, steep in whitened), float),
            np.asarray(sum(steep.T @ white for white, steep in whitened), float),
        )

    def step(
        self, unit: Float[Array, " F"], damping: Float[Array, " F"], slope: Float[Array, " F"] | None = None
    ) -> Float[Array, " F"]:
        """Return the step [F] from the point ``unit`` [F] that minimises the modelled cost within the unit box.

        ``damping`` [F] is added to the diagonal of the curvature. ``slope`` [F]: gradient to use instead of
        ``self.slope``.
        """
        factor = np.linalg.cholesky(self.curvature + np.diag(damping))
        aim = -np.linalg.solve(factor, self.slope if slope is None else slope)
        return np.asarray(scipy.optimize.lsq_linear(factor.T, aim, (-unit, 1.0 - unit), method="bvls").x)

    def decrease(self, steps: Float[Array, "S F"]) -> Float[Array, " S"]:
        """Decrease [S] of the cost that the model predicts for each of S ``steps`` [S, F]."""
        return np.asarray(-(steps @ self.slope) - 0.5 * np.einsum("dp,pq,dq->d", steps, self.curvature, steps))


@dataclass(frozen=True)
class Trials:
    """S trial points, each reached by a step with another damping, and the decrease of the cost at each of them.

    Attributes:
        units: [S, F] the trial points (F genes, scaled so that their bounds are 0 and 1).
        predicted: [S] decrease of the cost that the second-order model predicted.
        decrease: [S] decrease of the cost in simulations; -inf for a point that cannot be simulated.
    """

    units: Float[Array, "S F"]
    predicted: Float[Array, " S"]
    decrease: Float[Array, " S"]

    @classmethod
    def of(cls, units: Array, predicted: Array, before: float, after: Array, reasons: Sequence[str | None]) -> Trials:
        """Compare the cost ``before`` the step with the costs ``after`` [S] it at ``units`` [S, F].

        ``predicted`` [S]: predicted decreases. ``reasons`` [S]: why a point could not be simulated, None where it
        could.
        """
        failed = np.array([reason is not None for reason in reasons], bool)
        return cls(units, predicted, before - np.where(failed, np.inf, after))

    def best(self, least_gain: float = 0.0) -> int | None:
        """Index of the trial point with the largest decrease of the cost; None where no point qualifies.

        A point qualifies if its predicted decrease is positive and its decrease exceeds ``least_gain`` times the
        predicted one. At a bound, a step may consist of round-off only; the predicted decrease is then not positive.
        """
        good = (self.predicted > 0.0) & (self.decrease > least_gain * self.predicted)
        return int(np.argmax(np.where(good, self.decrease, -np.inf))) if good.any() else None

    def gain(self, k: int) -> float:
        """Decrease of the cost at trial point ``k``, divided by the predicted decrease."""
        return float(self.decrease[k] / self.predicted[k])
