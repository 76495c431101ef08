"""Find the markers nearest to a position, and the tangents of the wing at a marker, for faults of single markers."""

from __future__ import annotations

import numpy as np

from wingfit.records import Wing
from wingfit.records.array_types import Index
from wingfit.sim.effects.contract import Array, Values, place

PLACE = place(0.7, 0.5)
_NEAR = 0.05  # of the span: distance at which a neighbour has the weight exp(-1/2)


def nearest(wing: Wing, values: Values) -> Index:
    """Return the indices [B, M] of the M markers of ``wing``, sorted by distance at rest from a position.

    The position of each of B individuals is in ``values``: "station" (fraction of the span) and "chord" (of the chord).
    A fault affects only the nearest markers, so the observation jumps where the position comes nearer to another one. A
    gradient search therefore stays at a marker; only a trial of several positions finds the right one.
    """
    y, leading, chord = (np.array([getattr(s, a) for s in wing.stations]) for a in ("y", "leading_edge", "chord"))
    at = y[0] + values["station"] * (y[-1] - y[0])
    aft = np.interp(at, y, leading) + values["chord"] * np.interp(at, y, chord)
    rest = np.array([marker.position for marker in wing.markers])
    away = (rest[:, 0] - aft[:, None]) ** 2 + (rest[:, 1] - at[:, None]) ** 2
    return np.argsort(away, axis=1, kind="stable")


def tangents(rest: Array, marker: int, span: float) -> Array:
    """Return weights [2, M] with which the positions of M markers sum up to the wing's tangents at ``marker``.

    The tangents are the derivatives of the position by x and by y at rest, ``rest`` [M, 2] (m). The weights follow from
    a weighted least-squares plane through the markers around ``marker``, as near as a part of the ``span`` (m): exact
    for a uniform rotation and strain.
    """
    apart = rest - rest[marker]
    weight = np.exp(-0.25 * (apart**2).sum(axis=1) / (_NEAR * span) ** 2)
    plane = np.hstack([np.ones((len(rest), 1)), apart])
    return np.asarray((np.linalg.pinv(plane * weight[:, None]) * weight)[1:])
