"""Residuals in closed form: the minimum of a fit is known, and every evaluation is counted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from wingfit.calibration.problem import Problem
from wingfit.diagnosis.evidence import fit
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import Fit
from wingfit.records import Gene, Genome

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

NO_EVALUATOR = cast("Any", None)


@dataclass
class ClosedForm:
    """A subject and its data in one object: least squares in genes whose boxes are [0, 1].

    Attributes:
        residuals: gives [B, D] for genes [B, F].
        size: F.
        reach: an individual fails where a gene is farther than this from the genome of its initial motion.
        noise: of each residual.
        batches: genes [B, F] of each evaluated batch.
        initial_motions: the genome of the initial motion of each batch.
    """

    residuals: Callable[[Array], Array]
    size: int
    reach: float = np.inf
    noise: float = 1.0
    batches: list[Array] = field(default_factory=list)
    initial_motions: list[Array] = field(default_factory=list)

    @cached_property
    def problem(self) -> Problem:
        genes = tuple(Gene(f"gene_{k}", "1", 0.5, 0.0, 1.0, "linear", "any") for k in range(self.size))
        free = tuple(gene.name for gene in genes)
        return Problem(cast("Any", SimpleNamespace(genes=genes)), (), free, Genome.nominal(genes))

    def with_initial_motion(self, model: Any, genome: Array) -> Any:
        self.initial_motions.append(genome)
        return model

    @cached_property
    def scale(self) -> Array:
        return np.full(self.residuals(np.full((1, self.size), 0.5)).shape[1], self.noise)

    def whiten(self, coefficients: Array) -> Array:
        return np.asarray(coefficients / self.scale)

    def whitened_slopes(self, jacobian: Array) -> Array:
        return self.whiten(jacobian.T).T

    def chi_squared(self, coefficients: Array) -> float:
        return float(self.deviance(coefficients))

    def deviance(self, coefficients: Array) -> Array:
        return np.asarray((self.whiten(coefficients) ** 2).sum(axis=-1))

    def likelihood_weight(self, coefficients: Array) -> float:  # noqa: ARG002
        return 1.0

    def evaluate(self, problem: Problem, evaluator: Any, values: Array) -> tuple[Array, tuple[str | None, ...], Any]:  # noqa: ARG002
        assert ((values >= 0.0) & (values <= 1.0)).all(), "genes leave their boxes"
        self.batches.append(values)
        far = np.abs(values - self.initial_motions[-1]).max(axis=1) > self.reach
        found = np.where(far[:, None], np.nan, self.residuals(values))
        return found, tuple("it flutters" if one else None for one in far), [found[:, None]]

    @property
    def sizes(self) -> list[int]:
        """Number of individuals in each batch."""
        return [len(batch) for batch in self.batches]

    def broyden_fit(self, start: Array, jacobian: Array | None = None, known: Flags | None = None) -> Fit:
        """See :func:`wingfit.diagnosis.evidence.fit.broyden_fit`."""
        return fit.broyden_fit(self.context, self.problem, start, jacobian, known=known)

    def gauss_newton_fit(self, start: Array, steps: int) -> list[Fit]:
        """See :func:`wingfit.diagnosis.evidence.fit.gauss_newton_fit`."""
        return list(fit.gauss_newton_fit(self.context, self.problem, start, steps))

    def with_measured_jacobian(self, fitted: Fit) -> Fit:
        """See :func:`wingfit.diagnosis.evidence.fit.with_measured_jacobian`."""
        return fit.with_measured_jacobian(self.context, fitted)

    @property
    def simulator(self) -> fit._Simulator:
        """The simulator of a single step."""
        return fit._Simulator(self.context, self.problem)

    @property
    def context(self) -> FitContext:
        """Itself as subject and data: it has what fits use of both."""
        return FitContext(cast("Any", self), cast("Any", self), NO_EVALUATOR)
