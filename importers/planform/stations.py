"""Samples both edges of an outline along the span: few stations, linear in between, within a stated accuracy."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wingfit.importers.planform.slabs import slabs
from wingfit.records.array_types import Array, Float, Mask
from wingfit.records.errors import fail
from wingfit.records.limits import MAX_STATIONS

MIN_CHORD = 1e-4  # m, of a station in dataset.yaml


@dataclass(frozen=True, eq=False)
class Sections:
    """Stations: span positions ``y`` [S], ``leading`` and ``trailing`` edge x [S], m, rounded to ``decimals``.

    ``tolerance`` (m) is the largest distance of an edge from the outline, ``filled`` (m^2) the area of
    gaps that count as wing. ``widened``: a chord was below MIN_CHORD, the least that a dataset can have.
    """

    y: Float[Array, " S"]
    leading: Float[Array, " S"]
    trailing: Float[Array, " S"]
    decimals: int
    tolerance: float
    filled: float
    widened: bool

    @property
    def chord(self) -> Float[Array, " S"]:
        """Return the chords, m."""
        return self.trailing - self.leading


def sections(points: Float[Array, "N 2"], area: float, accuracy: float, where: str, *, fill: bool) -> Sections:
    """Return the stations of the outline ``points`` (x aft, y outboard, m), of the ``area`` m^2.

    The described edges are nowhere further than ``accuracy`` times area over perimeter from the outline, so that the
    area differs by at most the fraction ``accuracy``. DatasetError if the outline has gaps or overhangs of more than
    that and ``fill`` is false, or if it needs too many stations.
    """
    perimeter = float(np.hypot(*(points - np.roll(points, 1, axis=0)).T).sum())
    tolerance = accuracy * area / perimeter
    y, edges, filled = _edges(points, 0.2 * tolerance)
    if filled > accuracy * area and not fill:
        message = (
            f"has gaps or overhangs of {100 * filled / area:.2g} % of its area, seen along the chord; a wing is "
            f"described by one leading and one trailing edge: close the gaps, or give --fill-gaps to count them as wing"
        )
        raise fail(where, filled / area, message)
    keep = _thinned(y, edges, 0.8 * tolerance)
    if keep.sum() > MAX_STATIONS:
        message = f"needs {keep.sum()} stations for an accuracy of {accuracy:g}; at most {MAX_STATIONS} are read"
        raise fail(where, int(keep.sum()), f"{message}: give a larger --accuracy, or a smoother outline")
    decimals = math.ceil(-math.log10(0.05 * tolerance))
    y, edges = _with_least_chord(y[keep], edges[keep], 2 * 10.0**-decimals)
    leading, trailing = edges.T
    narrow = trailing - leading < MIN_CHORD
    middle = 0.5 * (leading + trailing)
    leading = np.where(narrow, middle - 0.5 * MIN_CHORD, leading)
    trailing = np.where(narrow, middle + 0.5 * MIN_CHORD, trailing)
    leading = np.round(leading, decimals)
    chord = np.maximum(np.round(trailing - leading, decimals), MIN_CHORD)
    return Sections(np.round(y, decimals), leading, leading + chord, decimals, tolerance, filled, bool(narrow.any()))


def _edges(points: Float[Array, "N 2"], step: float) -> tuple[Float[Array, " K"], Float[Array, "K 2"], float]:
    """Return span positions, (leading, trailing) edge there, and the area of the gaps between the two.

    Where an edge jumps, along a line parallel to the chord, the second of two positions is ``step`` further out.
    """
    y, edges, filled = list[float](), list[tuple[float, float]](), 0.0
    for slab in slabs(points):
        filled += slab.gap
        low, high = ((float(ends.min()), float(ends.max())) for ends in (slab.at_low, slab.at_high))
        if not y:
            y.append(slab.low)
            edges.append(low)
        elif max(abs(low[0] - edges[-1][0]), abs(low[1] - edges[-1][1])) > step and y[-1] + step < slab.high:
            y.append(y[-1] + step)
            edges.append(low)
        y.append(slab.high)
        edges.append(high)
    return np.array(y), np.array(edges), filled


def _with_least_chord(
    y: Float[Array, " S"], edges: Float[Array, "S 2"], step: float
) -> tuple[Float[Array, " S"], Float[Array, "S 2"]]:
    """Return the stations with one more wherever the chord, towards a pointed tip, falls below MIN_CHORD.

    Beyond it the chord will be MIN_CHORD; without it the whole part up to the next station would be too wide.
    """
    chord = edges[:, 1] - edges[:, 0]
    new = list[float]()
    for k in range(len(y) - 1):
        if (chord[k] < MIN_CHORD) != (chord[k + 1] < MIN_CHORD):
            at = float(y[k] + (MIN_CHORD - chord[k]) / (chord[k + 1] - chord[k]) * (y[k + 1] - y[k]))
            if y[k] + step < at < y[k + 1] - step:
                new.append(at)
    places = np.sort(np.append(y, new))
    return places, np.column_stack([np.interp(places, y, edges[:, side]) for side in (0, 1)])


def _thinned(y: Float[Array, " K"], edges: Float[Array, "K 2"], tolerance: float) -> Mask:
    """Return which positions are kept so that lines are within ``tolerance`` of the edges (Douglas-Peucker)."""
    keep = np.zeros(len(y), dtype=np.bool_)
    keep[[0, -1]] = True
    parts = [(0, len(y) - 1)]
    while parts:
        first, last = parts.pop()
        if last - first < 2:
            continue
        inner = slice(first + 1, last)
        along = (y[inner] - y[first]) / (y[last] - y[first])
        line = edges[first] + along[:, None] * (edges[last] - edges[first])
        slope = (edges[last] - edges[first]) / (y[last] - y[first])
        error = (np.abs(edges[inner] - line) / np.hypot(1.0, slope)).max(axis=1)
        if error.max() > tolerance:
            middle = first + 1 + int(error.argmax())
            keep[middle] = True
            parts += [(first, middle), (middle, last)]
    return keep
