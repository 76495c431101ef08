"""Recorded and simulated values over time, for plots: of the channels that fit worst."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wingfit.calibration.series.misfits import Compared
from wingfit.calibration.series.result import Curve, RelativeTo
from wingfit.records.array_types import Array

MOST_CURVES = 24
MOST_POINTS = 600  # of a curve


def curves(everywhere: Sequence[Compared], held_out: Sequence[Compared], relative_to: RelativeTo) -> tuple[Curve, ...]:
    """Return the curves of up to MOST_CURVES channels of recordings, those that the best genome fits worst first.

    Where the best genome cannot be simulated, the misfit of the nominal one decides.
    """
    ranked = []
    for one in everywhere:
        which = 0 if one.reasons[1] else 1
        scaled = np.sqrt(one.squares(which) / np.maximum(one.samples, 1)) / one.scale(relative_to)
        misfits = np.where(np.isfinite(scaled), scaled, np.inf)
        ranked += [(float(misfits[c]), one, c) for c in np.flatnonzero(one.samples)]
    worst = sorted(ranked, key=lambda found: -found[0])[:MOST_CURVES]
    return tuple(_curve(one, int(c), held_out=one in held_out) for _, one, c in worst)


def _curve(one: Compared, c: int, *, held_out: bool) -> Curve:
    recording, seen = one.recording, np.flatnonzero(one.recording.valid[:, c])
    stride = -(-len(seen) // MOST_POINTS)
    some = seen[::stride]
    recorded = recording.values[some, c]

    def simulated(which: int) -> tuple[float, ...] | None:
        return None if one.reasons[which] else _plain(recorded + one.residuals[which][some, c])

    return Curve(
        recording=recording.name,
        channel=recording.channels[c],
        unit=recording.quantities[c].unit,
        held_out=held_out,
        stride=stride,
        time=_plain(recording.times[some]),
        recorded=_plain(recorded),
        nominal=simulated(0),
        best=simulated(1),
    )


def _plain(values: Array) -> tuple[float, ...]:
    return tuple(np.asarray(values, np.float64).tolist())
