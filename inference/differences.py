"""Derivatives of simulated outputs with respect to genes by finite differences, all simulated in one batch.

Genes are scaled so that their bounds are 0 and 1 (:meth:`wingfit.records.Gene.to_unit`): logarithmically for a gene
whose scale is "log".
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wingfit.records.array_types import Array, Bool, Float, Index, Int, Mask

Outputs = Sequence[Array]
Simulate = Callable[[Array], tuple[Outputs, Sequence[str | None]]]
"""Simulates scaled genes [B, F] of B individuals: returns arrays [B, ...], and why each failed (None: it did not)."""

# Change of a gene scaled to 0..1: about 1 % of its value for the bounds of the thesis (a fifth to five times the
# estimate). Simulated motions have errors of some hundredths of a millimetre, different at each point: much smaller
# steps would measure these errors, larger steps the curvature (docs/estimation.md has the figures).
STEP = 0.003
# Change of a gene where a model differentiates the motion that it computes: the error is of this size, relative.
TANGENT_STEP = 1e-6


class NotSimulatedError(ValueError):
    """Raised where the point to be differentiated cannot be simulated."""


@dataclass(frozen=True)
class Differences:
    """Simulated outputs at a point, and their derivatives with respect to K scaled genes.

    Attributes:
        outputs: one array [...] for each output, at the point.
        slopes: derivatives [..., K] of each output; zero for a gene that could not be differentiated, and where an
        output is NaN at the point.
        known: [K], False for a gene that could not be differentiated, because the simulations at all its neighbouring
        points failed.
        evaluations: number of individuals simulated.
        reasons: messages of the simulations that failed at neighbouring points.
    """

    outputs: tuple[Array, ...]
    slopes: tuple[Array, ...]
    known: Bool[Mask, " K"]
    evaluations: int
    reasons: tuple[str, ...]


def differences(
    simulate: Simulate,
    unit: Float[Array, " F"],
    columns: Int[Index, " K"],
    *,
    at: Outputs | None = None,
    step: float = STEP,
    sides: int = 2,
) -> Differences:
    """Differentiate outputs at the point ``unit`` [F] (genes scaled to 0..1) with respect to the genes ``columns`` [K].

    ``columns`` are indices into ``unit``. With ``sides`` = 2, each gene is changed by ``step`` up and down (central
    differences); with 1, only up, or down where the upper bound is closer than ``step``. A changed gene is clipped to
    its bounds. Where one of the two simulations of a gene fails, the point itself takes its place, so that the
    difference is one-sided. ``at``: outputs at the point if they are known already. NotSimulatedError if the point
    cannot be simulated.
    """
    moves = step * np.eye(len(unit))[columns]
    moves[unit[columns] > 1.0 - step] *= -1.0
    neighbours = np.clip(np.vstack([unit + moves, *([unit - moves] if sides == 2 else [])]), 0.0, 1.0)
    batch = neighbours if at is not None else np.vstack([unit[None], neighbours])
    found, reasons = simulate(batch)
    if at is None:
        if reasons[0] is not None:
            raise NotSimulatedError(f"the genome to be differentiated cannot be simulated: {reasons[0]}")
        at, found, reasons = [part[0] for part in found], [part[1:] for part in found], reasons[1:]
    failed = np.array([reason is not None for reason in reasons], bool)
    neighbours[failed] = unit
    up, down = neighbours[: len(columns)], neighbours[len(columns) :] if sides == 2 else unit[None]
    width = (up - down)[np.arange(len(columns)), columns]
    slopes = [_slopes(base, part, failed, width) for base, part in zip(at, found, strict=True)]
    return Differences(tuple(at), tuple(slopes), width != 0.0, len(batch), tuple(r for r in reasons if r))


def derivatives(
    simulate: Simulate,
    tangent: Simulate | None,
    unit: Float[Array, " F"],
    columns: Int[Index, " K"],
    *,
    at: Outputs | None = None,
    sides: int = 2,
) -> Differences:
    """Differentiate outputs as :func:`differences` does, by exact derivatives of the simulated motion where it has any.

    ``tangent`` simulates neighbours of ``unit``, the first of every batch, exactly to first order in their distance,
    and fails where there is no derivative, which is not reported as a failure; None for a model without derivatives.
    ``at`` is used by ``simulate`` only.
    """
    if tangent is None:
        return differences(simulate, unit, columns, at=at, sides=sides)
    try:
        found = replace(differences(tangent, unit, columns, step=TANGENT_STEP, sides=1), reasons=())
    except ValueError:  # no periodic motion that can be differentiated
        return differences(simulate, unit, columns, at=at, sides=sides)
    return with_more(found, simulate, unit, columns, at=at, sides=sides)


def with_more(
    found: Differences,
    simulate: Simulate,
    unit: Float[Array, " F"],
    columns: Int[Index, " K"],
    *,
    at: Outputs | None = None,
    step: float = STEP,
    sides: int = 2,
) -> Differences:
    """Return ``found`` with differences of another ``step`` for those of its ``columns`` that it does not know."""
    failed = np.flatnonzero(~found.known)
    if not len(failed):
        return found
    again = differences(simulate, unit, columns[failed], at=found.outputs if at is None else at, step=step, sides=sides)
    known, slopes = found.known.copy(), [one.copy() for one in found.slopes]
    known[failed] = again.known
    for one, new in zip(slopes, again.slopes, strict=True):
        one[..., failed] = new
    evaluations, reasons = found.evaluations + again.evaluations, (*found.reasons, *again.reasons)
    return Differences(found.outputs, tuple(slopes), known, evaluations, reasons)


def _slopes(base: Array, neighbours: Array, failed: Mask, width: Array) -> Array:
    """Derivatives [..., K] of one output with respect to K genes.

    ``base`` [...]: the output at the point. ``neighbours`` [K or 2 K, ...]: the output with each gene changed up, then
    down; ``failed`` marks those that could not be simulated. ``width`` [K]: distance between the two values of each
    gene.
    """
    values = np.where(failed.reshape(-1, *[1] * base.ndim), base, neighbours)
    down = values[len(width) :] if len(values) > len(width) else base
    change = np.where(np.isfinite(base), values[: len(width)] - down, 0.0)
    slopes = change / np.where(width != 0.0, width, 1.0).reshape(-1, *[1] * base.ndim)
    return np.ascontiguousarray(np.moveaxis(slopes, 0, -1))
