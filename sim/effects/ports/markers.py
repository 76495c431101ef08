"""Which marker a fault concerns, and where its neighbours say it would be if it sat elsewhere on the wing."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wingfit.records import Wing
from wingfit.sim.effects.contract import Array, Values, place

PLACE = place(0.7, 0.5)
_NEAR = 0.05  # of the span: neighbours so far away count for exp(-1/2)


def nearest(wing: Wing, values: Values) -> npt.NDArray[np.intp]:
    """Markers [B, M] of ``wing`` from the nearest to the place PLACE [B] at rest to the farthest.

    A fault concerns this marker or that and never a mixture, so what is observed jumps as the place goes from one to
    the next. A search by slopes holds a place; one by trial finds it.
    """
    y, leading, chord = (np.array([getattr(s, a) for s in wing.stations]) for a in ("y", "leading_edge", "chord"))
    at = y[0] + values["station"] * (y[-1] - y[0])
    aft = np.interp(at, y, leading) + values["chord"] * np.interp(at, y, chord)
    rest = np.array([marker.position for marker in wing.markers])
    away = (rest[:, 0] - aft[:, None]) ** 2 + (rest[:, 1] - at[:, None]) ** 2
    return np.argsort(away, axis=1, kind="stable")


def tangents(wing: Wing, marker: int) -> Array:
    """Weights [2, M] that make of the markers' positions the derivatives along x and y at ``marker`` at rest.

    Least squares of a plane through the markers around it: exact wherever the wing turns and stretches evenly.
    """
    rest = np.array([m.position[:2] for m in wing.markers])
    apart = rest - rest[marker]
    weight = np.exp(-0.25 * (apart**2).sum(axis=1) / (_NEAR * wing.span) ** 2)
    plane = np.hstack([np.ones((len(rest), 1)), apart])
    return np.asarray((np.linalg.pinv(plane * weight[:, None]) * weight)[1:])
