"""Which track is which marker, once the wing's motion is known: whole tracks, and frame by frame where tracks swap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Index, Mask
from wingfit.tracking.alignment.candidates import assigned

_SURE = 0.7  # of the gate: farther tracks are no marker's
_APART = 2.0  # a second marker must be as many times farther than the first
_NOISES = 6.0  # a sample that is farther from its marker, in standard deviations, may be of another marker
_PART = 0.35  # of the gate, at least as far


@dataclass(frozen=True)
class Exchange:
    """Samples of a track that belong to another marker than the track: a swap, or a track that goes on as another one.

    Attributes:
        track: name of the track.
        marker: that the samples belong to.
        start_s, end_s: times of the first and the last of them, s.
        frames: count.
    """

    track: str
    marker: str
    start_s: float
    end_s: float
    frames: int


def whole_tracks(points: Array, model: Array, gate: float) -> tuple[Index, Array, Mask]:
    """Assign whole tracks to markers by their distance over the recording.

    Args:
        points: [T, K, 3] tracks in hinge coordinates, m; NaN where not seen.
        model: [T, M, 3] modelled positions of the markers, m.
        gate: distance beyond which a track is not a marker, m.

    Returns:
        Marker [K] of each track (-1: none), RMS distance [K, M] (m, cut off at the gate), and whether the marker is
        doubtful [K], because another one is nearly as near.

    """
    K, M = points.shape[1], model.shape[1]
    away, doubtful = np.full((K, M), gate), np.zeros(K, dtype=bool)
    for k in range(K):
        squares = ((points[:, k, None] - model) ** 2).sum(axis=-1)
        seen = np.isfinite(squares[:, 0])
        if not seen.any():
            continue
        away[k] = np.sqrt(np.minimum(squares[seen], gate**2).mean(axis=0))
        # In the same frame, so that a track that swaps is not doubtful.
        first, second = np.sqrt(np.partition(squares[seen], 1, axis=1)[:, :2].T) if M > 1 else (0.0, np.inf)
        doubtful[k] = np.median(second) < _APART * np.median(first)
    marker = assigned(away, _SURE * gate)
    return marker, away, doubtful & (marker >= 0)


def frame_by_frame(points: Array, model: Array, marker: Index, noise: float, gate: float) -> Index:
    """Return the track [T, M] that shows each marker in each frame (-1: none).

    A sample near the marker of its track belongs to it. The others are assigned to markers that are free in that frame
    and as near; samples that are near none belong to no marker. Arguments as of :func:`whole_tracks`; ``noise`` is the
    standard deviation of a coordinate, m.
    """
    T, K = points.shape[:2]
    near = max(_NOISES * noise, _PART * gate)
    seen = np.isfinite(points[..., 0])
    home = np.full((T, K), np.inf)
    known = np.flatnonzero(marker >= 0)
    home[:, known] = np.linalg.norm(points[:, known] - model[:, marker[known]], axis=-1)
    own = seen & (home < near)
    found = np.full((T, model.shape[1]), -1)
    for k in known:
        found[own[:, k], marker[k]] = k
    for t in np.flatnonzero((seen & ~own).any(axis=1)):
        lost, free = np.flatnonzero(seen[t] & ~own[t]), np.flatnonzero(found[t] < 0)
        away = np.linalg.norm(points[t, lost][:, None] - model[t, free][None], axis=-1)
        for k, m in zip(lost, assigned(away, near), strict=True):
            if m >= 0:
                found[t, free[m]] = k
    return found


def exchanges(
    found: Index, marker: Index, times: Array, tracks: tuple[str, ...], markers: tuple[str, ...]
) -> list[Exchange]:
    """Return what :func:`frame_by_frame` changed against whole tracks, a line for each track and marker."""
    result = []
    for m, name in enumerate(markers):
        for k in np.unique(found[:, m]):
            if k < 0 or marker[k] == m:
                continue
            frames = np.flatnonzero(found[:, m] == k)
            ends = float(times[frames[0]]), float(times[frames[-1]])
            result.append(Exchange(tracks[k], name, *ends, len(frames)))
    return sorted(result, key=lambda one: (one.start_s, one.track))


def gathered(positions: Array, found: Index) -> Array:
    """Return the positions [T, M, 3] of the markers from those of the tracks [T, K, 3] and ``found`` [T, M]."""
    taken = np.take_along_axis(positions, np.maximum(found, 0)[..., None], axis=1)
    return np.where(found[..., None] >= 0, taken, np.nan)
