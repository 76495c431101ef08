"""The flap frequency of tracks whose frequency nobody has stated."""

from __future__ import annotations

import numpy as np

from wingfit.importers.start.harmonics import columns
from wingfit.records.array_types import Array, Float

HARMONICS = 2
LEAST_BEATS = 1.5  # in a recording, of a frequency that is found; lower ones are tried, which may explain it better
TRIED_BEATS = 1.0
LEAST_EXPLAINED = 0.8  # of the variance, by the harmonics of the frequency; with less, no frequency is clear
PARTS = (
    (0.0, 1.0),
    (0.0, 0.5),
    (0.5, 1.0),
    (0.25, 0.75),
    (0.0, 0.34),
    (0.33, 0.67),
    (0.66, 1.0),
)  # of a recording that are tried: a bird flaps, then glides
LEAST_ROWS = 24
LEAST_MOTION = 1e-9  # m: markers that move less are at rest
LEAST_SEEN = 0.65  # of the rows, of a column that is used; its gaps are bridged by straight lines
AS_GOOD = 0.9  # of the variance that the best frequency explains: multiples of a beat explain as much as the beat
# Of what both harmonics explain, by the first: with less, a higher frequency, which is not tried, explains it.
LEAST_FIRST = 0.5
LEAST_KEPT = 0.85  # of the variance, by means of neighbouring rows: with less, they hide the beat
MOST_ROWS, MOST_TRIED, MOST_COLUMNS = 600, 1500, 12


def flap_frequency(times: Float[Array, " T"], positions: Float[Array, "T M 3"]) -> float | None:
    """Return the frequency (Hz) with whose harmonics the markers move most; None if none is clear.

    ``times`` in s, ``positions`` in m with NaN in gaps. Only y and z are used: a wing flaps about x.
    """
    values = positions[:, :, 1:].reshape(len(times), -1)
    values = values[:, np.isfinite(values).mean(axis=0) >= LEAST_SEEN][:, :MOST_COLUMNS]
    if not values.shape[1]:
        return None
    values = np.column_stack([_bridged(times, column) for column in values.T])
    since, values = _thinned(times - times[0], values)
    for start, end in PARTS:
        part = np.flatnonzero((since >= start * since[-1]) & (since <= end * since[-1]))
        part = part[max(0, (len(part) - MOST_ROWS) // 2) :][:MOST_ROWS]
        found = _of_part(since[part], values[part])
        if found is not None:
            return found
    return None


def _bridged(times: Array, column: Array) -> Array:
    seen = np.isfinite(column)
    bridged: Array = np.interp(times, times[seen], column[seen])
    return bridged


def _thinned(since: Array, values: Array) -> tuple[Array, Array]:
    """Return means of neighbouring rows, of at most MOST_ROWS if these still show the motion; else of more.

    Rows that are left out, instead, would show a fast beat as a slow one.
    """
    level = _without_drift(since, values)
    step = -(-len(since) // MOST_ROWS)
    while step > 1:
        if (_means(level, step) ** 2).mean() >= LEAST_KEPT * (level**2).mean():
            return _means(since, step), _means(values, step)
        step //= 2
    return since, values


def _means(rows: Array, step: int) -> Array:
    whole = len(rows) // step * step
    means: Array = rows[:whole].reshape(-1, step, *rows.shape[1:]).mean(axis=1)
    return means


def _without_drift(since: Array, values: Array) -> Array:
    drift = np.column_stack([np.ones_like(since), since])
    left: Array = values - drift @ np.linalg.lstsq(drift, values, rcond=None)[0]
    return left


def _of_part(since: Array, values: Array) -> float | None:
    """Return the frequency (Hz) of ``values`` [T, C] at the times ``since`` (s); None if none is clear."""
    if len(since) < LEAST_ROWS or not np.ptp(values, axis=0).max() > LEAST_MOTION:
        return None
    since = since - since[0]
    values = _without_drift(since, values)
    lowest = TRIED_BEATS / since[-1]
    highest = 0.25 / float(np.median(np.diff(since)))
    if highest <= lowest:
        return None
    # A fifth of a beat over the recording is the smallest difference that shows.
    count = min(MOST_TRIED, max(2, int(5 * (highest - lowest) * since[-1])))
    tried = np.linspace(lowest, highest, count)
    explained = np.array([_explained(since, values, one) for one in tried])
    if explained.max() < LEAST_EXPLAINED:
        return None
    peaks = [k for k in range(count) if explained[k] == explained[max(0, k - 1) : k + 2].max()]
    best = max(k for k in peaks if explained[k] >= AS_GOOD * explained.max())
    step = tried[1] - tried[0]
    near = np.linspace(max(lowest, tried[best] - step), tried[best] + step, 41)
    found = float(near[int(np.argmax([_explained(since, values, one) for one in near]))])
    if found * since[-1] < LEAST_BEATS:
        return None
    first = _explained(since, values, found, 1) - _explained(since, values, found, 0)
    return found if first >= LEAST_FIRST * _explained(since, values, found) else None


def _explained(times: Array, values: Array, frequency: float, harmonics: int = HARMONICS) -> float:
    """Return the part of the squares of ``values`` [T, C] that a line and harmonics of ``frequency`` (Hz) explain."""
    basis, _ = np.linalg.qr(columns(times, frequency, harmonics, drifts=True))
    left = values - basis @ (basis.T @ values)
    return 1.0 - float((left**2).sum() / (values**2).sum())
