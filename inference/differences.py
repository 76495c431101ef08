"""Derivatives of simulated outputs by finite differences in the unit box, all neighbours in one batch.

Coordinates are the genes' unit coordinates (:meth:`wingfit.records.Gene.to_unit`): logarithmic for a log gene, the box
[0, 1].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Bool, Float, Index, Int, Mask

Outputs = Sequence[Array]
Simulate = Callable[[Array], tuple[Outputs, Sequence[str | None]]]
"""From unit coordinates [B, F] to outputs, arrays [B, ...], and why each individual failed (None where it did not)."""

# In unit coordinates; 1 % of a gene whose box is the thesis's. Simulated motions carry an error of some hundredths of a
# millimetre that differs from one neighbour to the next; much smaller steps would measure it, larger ones the
# curvature (docs/estimation.md has the figures).
STEP = 0.003


@dataclass(frozen=True)
class Differences:
    """Outputs at a point and their derivatives with respect to K genes.

    Attributes:
        outputs: at the point, each [...].
        slopes: derivative of each output, [..., K]; zero for a gene that could not be differentiated, and where an
            output is NaN at the point.
        known: [K], False for a gene both of whose neighbours fail.
        evaluations: individuals simulated.
        reasons: why neighbours failed.
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
    """Differentiate about ``unit`` [F] with respect to the genes ``columns`` [K], to one or two ``sides``.

    A step that would leave the box ends at its edge, or is taken inwards where there is only one side. A neighbour that
    fails is replaced by the point itself, so that differences may become one-sided. ``at`` are the outputs at the point
    where they are known. ValueError where the point cannot be simulated.
    """
    moves = step * np.eye(len(unit))[columns]
    moves[unit[columns] > 1.0 - step] *= -1.0
    neighbours = np.clip(np.vstack([unit + moves, *([unit - moves] if sides == 2 else [])]), 0.0, 1.0)
    batch = neighbours if at is not None else np.vstack([unit[None], neighbours])
    found, reasons = simulate(batch)
    if at is None:
        if reasons[0] is not None:
            raise ValueError(f"the genome to be differentiated cannot be simulated: {reasons[0]}")
        at, found, reasons = [part[0] for part in found], [part[1:] for part in found], reasons[1:]
    failed = np.array([reason is not None for reason in reasons], bool)
    neighbours[failed] = unit
    up, down = neighbours[: len(columns)], neighbours[len(columns) :] if sides == 2 else unit[None]
    width = (up - down)[np.arange(len(columns)), columns]
    slopes = [_slopes(base, part, failed, width) for base, part in zip(at, found, strict=True)]
    return Differences(tuple(at), tuple(slopes), width != 0.0, len(batch), tuple(r for r in reasons if r))


def _slopes(base: Array, neighbours: Array, failed: Mask, width: Array) -> Array:
    """Slopes [..., K] of one output by K genes, from its values at the base point and at K or 2 K neighbours."""
    values = np.where(failed.reshape(-1, *[1] * base.ndim), base, neighbours)
    down = values[len(width) :] if len(values) > len(width) else base
    change = np.where(np.isfinite(base), values[: len(width)] - down, 0.0)
    slopes = change / np.where(width != 0.0, width, 1.0).reshape(-1, *[1] * base.ndim)
    return np.ascontiguousarray(np.moveaxis(slopes, 0, -1))
