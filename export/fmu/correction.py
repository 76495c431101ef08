"""Forces of effects that an FMU does not compute at each instant, as a table over conditions and the beat.

The table holds, at Chebyshev nodes of flap frequency, airspeed and body pitch, the difference of the whole model and
the part that is computed directly, over a steady beat. Between nodes it is the polynomial through all of them
(Berrut and Trefethen, *Barycentric Lagrange Interpolation*, SIAM Review 46, 2004).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wingfit.export.fmu.conditions import fitted_range
from wingfit.export.fmu.product import NotExportedError
from wingfit.export.fmu.vehicle_laws import CONDITION_FIELDS, DirectVehicle
from wingfit.records import Condition
from wingfit.records.array_types import Array

ACCURACY = 5e-4  # of the force's amplitude, at conditions between the nodes
_ORDERS = (3, 5, 7, 9)  # nodes along each input, tried in turn
_CHECKS = 6  # conditions at which a table is verified
_NARROW = 1e-9  # relative: a range that is one value


@dataclass(frozen=True)
class Correction:
    """A table [M1, M2, M3, n, 2] of forces (N); see :class:`wingfit.export.fmu.kernels.vehicle_step.Parts`."""

    nodes: Array
    barycentric: Array
    counts: Array
    table: Array


def correction_of(direct: DirectVehicle) -> Correction:
    """Return the correction for the effects that are not computed directly; empty if there are none.

    NotExportedError if it is not accurate with the largest table.
    """
    if not direct.corrected:
        empty = np.zeros((3, 1))
        return Correction(empty, empty.copy(), np.ones(3), np.zeros((1, 1, 1, 0, 2)))
    random, worst = np.random.default_rng(1), np.inf
    ends = [fitted_range(direct.model, direct.condition, name) for name in CONDITION_FIELDS]
    checks = [
        replace(
            direct.condition, **{name: random.uniform(*end) for name, end in zip(CONDITION_FIELDS, ends, strict=True)}
        )
        for _ in range(_CHECKS)
    ]
    wanted = [(direct.forces(one), direct.forces(one) - direct.direct_forces(one)) for one in checks]
    for order in _ORDERS:
        found = _table(direct, ends, order)
        worst = max(
            float(np.abs(at(found, one) - more).max() / (0.5 * np.ptp(whole, axis=0).max()))
            for one, (whole, more) in zip(checks, wanted, strict=True)
        )
        if worst <= ACCURACY:
            return found
    raise NotExportedError(
        f"the forces of {', '.join(direct.corrected)} vary too fast with the condition for an FMU: the error is "
        f"{100 * worst:.2g} % of the amplitude, the limit {100 * ACCURACY:g} %: export the model for a narrower range "
        "of recordings, or without these effects"
    )


def _table(direct: DirectVehicle, ends: list[tuple[float, float]], order: int) -> Correction:
    counts = [1 if high - low <= _NARROW * max(abs(high), 1e-9) else order for low, high in ends]
    nodes, barycentric = np.zeros((3, order)), np.zeros((3, order))
    for d, ((low, high), count) in enumerate(zip(ends, counts, strict=True)):
        k = np.arange(count)
        x = -np.cos(np.pi * k / max(count - 1, 1)) if count > 1 else np.zeros(1)
        nodes[d, :count] = 0.5 * (low + high) + 0.5 * (high - low) * x
        nodes[d, 0], nodes[d, count - 1] = (low, high) if count > 1 else (nodes[d, 0], nodes[d, 0])
        barycentric[d, :count] = (-1.0) ** k * np.where((k == 0) | (k == count - 1), 0.5, 1.0)
    table = np.zeros((*counts, direct.simulation.instants, 2))
    for place in np.ndindex(*counts):
        values = {name: float(nodes[d, place[d]]) for d, name in enumerate(CONDITION_FIELDS)}
        condition = replace(direct.condition, **values)
        table[place] = direct.forces(condition) - direct.direct_forces(condition)
    return Correction(nodes, barycentric, np.array(counts, float), table)


def at(correction: Correction, condition: Condition) -> Array:
    """Return the correction [n, 2] over a beat under ``condition``, N."""
    table = correction.table
    for d, name in enumerate(CONDITION_FIELDS):
        count = int(correction.counts[d])
        apart = getattr(condition, name) - correction.nodes[d, :count]
        exact = apart == 0.0
        share = exact.astype(float) if exact.any() else correction.barycentric[d, :count] / apart
        table = np.tensordot(share / share.sum(), table, axes=1)
    return np.asarray(table)
