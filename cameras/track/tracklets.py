"""Detections of one camera joined from frame to frame, so that they can be read at any instant between frames.

A camera with a rolling shutter, or one that is not synchronised, sees no two markers at the instant that is sought.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from wingfit.cameras.markers.detections import Detections, joined
from wingfit.cameras.track.registration import spacing
from wingfit.records.array_types import Array, Float, Index

_NEIGHBOURS = 4  # of which the velocity is taken for a detection that has none
_SAME = 1e-6  # of the longest time between samples
_GATE = 0.35  # of the distance between neighbouring detections
_REACH = 3  # longest times between samples from which a cubic has its samples


@dataclass(frozen=True, eq=False)
class Tracklets:
    """Which detections of a camera belong together.

    Attributes:
        frames: the detections in each frame, F frames.
        frame_times: [F] (s), when the first row of each frame was exposed, on the camera's clock; they increase.
        row_s: time from row to row (s).
        starts: [F + 1], count of detections before each frame, and of all.
        owner: [N], number of the tracklet of each detection, in the order of the frames.
        rows_s: the earliest and the latest time of a detection after the first row of its frame (s).
        period: the first and the last time of a detection (s).
    """

    frames: Sequence[Detections]
    frame_times: Float[Array, " F"]
    row_s: float
    starts: Index
    owner: Index
    rows_s: tuple[float, float]
    period: tuple[float, float]


def join(frames: Sequence[Detections], frame_times: Float[Array, " F"], row_s: float) -> Tracklets:
    """Join detections of consecutive frames: each is sought where its velocity and that of its neighbours lead."""
    counts, rows_s, period = [0], (np.inf, -np.inf), (np.inf, -np.inf)
    for frame, begin in zip(frames, frame_times, strict=True):
        counts.append(len(frame))
        if len(frame):
            late = frame.pixels[:, 1] * row_s
            rows_s = min(rows_s[0], float(late.min())), max(rows_s[1], float(late.max()))
            times = begin + late
            period = min(period[0], float(times.min())), max(period[1], float(times.max()))
    starts = np.cumsum(counts)
    owner = np.full(starts[-1], -1)
    start = _calmest(frames, np.diff(starts))
    names = len(frames[start])
    owner[starts[start] : starts[start + 1]] = np.arange(names)
    for direction in (1, -1):
        one = frames[start]
        velocity = np.zeros((len(one), 2))
        last = len(frames) - 1 if direction > 0 else 0
        for at in range(start, last, direction):
            two, there = frames[at + direction], at + direction
            labels = owner[starts[at] : starts[at + 1]]
            found, velocity = _step((one, two), labels, velocity, names)
            owner[starts[there] : starts[there + 1]] = found
            names = max(names, int(found.max(initial=-1)) + 1)
            one = two
    return Tracklets(frames, frame_times, row_s, starts, owner, rows_s, period)


def _calmest(frames: Sequence[Detections], counts: Index) -> int:
    """Return the frame from which the detections move least to the next, among those that see most of them."""
    many = np.percentile(counts, 70)
    best, least = 0, np.inf
    for number, (one, two) in enumerate(pairwise(frames)):
        if len(one) < max(many, 2) or len(two) < 2:
            continue
        moved = float(np.median(cKDTree(two.pixels).query(one.pixels)[0]))
        if moved < least:
            best, least = number, moved
    return best


def _step(pair: tuple[Detections, Detections], labels: Index, velocity: Array, names: int) -> tuple[Index, Array]:
    """Join the detections of the second frame of ``pair`` to those of the first.

    ``labels`` and ``velocity`` (pixels per frame) are those of the first frame; returns those of the second. New
    tracklets are numbered from ``names``.
    """
    one, two = pair
    found, moves = np.full(len(two), -1), np.zeros((len(two), 2))
    if len(one) >= 2 and len(two) >= 1:
        expected = one.pixels + velocity
        gate = _GATE * spacing(one.pixels)
        apart, index = cKDTree(two.pixels).query(expected)
        back = cKDTree(expected).query(two.pixels)[1]
        good = (apart < gate) & (back[index] == np.arange(len(one)))
        found[index[good]] = labels[good]
        moves[index[good]] = two.pixels[index[good]] - one.pixels[good]
    new = np.flatnonzero(found < 0)
    found[new] = names + np.arange(len(new))
    known = np.flatnonzero(found < names)
    if len(new) and len(known) >= _NEIGHBOURS:
        near = cKDTree(two.pixels[known]).query(two.pixels[new], k=_NEIGHBOURS)[1]
        moves[new] = np.median(moves[known][near], axis=1)
    return found, moves


def at_time(tracklets: Tracklets, time: float, longest: float) -> Detections:
    """Return the detections at ``time`` (s, the camera's clock), by cubics through the two samples before and after.

    A tracklet is read if its samples around ``time`` are at most ``longest`` (s) apart. The covariance has that of the
    samples, and a tenth of the difference to a straight line between the nearest two for what a cubic cannot follow.
    """
    return owned_at_time(tracklets, time, longest)[0]


def owned_at_time(tracklets: Tracklets, time: float, longest: float) -> tuple[Detections, Index]:
    """Return the detections of ``at_time``, and the number [N] of the tracklet of each."""
    times, owner, seen = _around(tracklets, time, _REACH * longest)
    before = np.flatnonzero((times[:-1] <= time) & (times[1:] > time) & (owner[:-1] == owner[1:]))
    before = before[times[before + 1] - times[before] <= longest]
    # The last sample of a tracklet, and one before a gap, can be read at their own time.
    exact = np.flatnonzero(np.abs(times - time) < _SAME * longest)
    exact = exact[~np.isin(owner[exact], owner[before])]
    alone = seen.only(exact)
    if not len(before):
        return alone, owner[exact]
    around = before[:, None] + np.arange(-1, 3)
    index = np.clip(around, 0, len(times) - 1)
    inside = (owner[index] == owner[before][:, None]) & (index == around)  # each sample once
    gaps = np.abs(times[index] - time) < _REACH * longest
    weights = _lagrange(times[index], time, inside & gaps)
    share = (time - times[before]) / (times[before + 1] - times[before])
    pixels = np.einsum("nk,nki->ni", weights, seen.pixels[index])
    straight = (1 - share)[:, None] * seen.pixels[before] + share[:, None] * seen.pixels[before + 1]
    covariance = np.einsum("nk,nkij->nij", weights**2, seen.covariance[index])
    covariance += ((0.1 * np.linalg.norm(pixels - straight, axis=1)) ** 2)[:, None, None] * np.eye(2)
    nearest = before + (share > 0.5)
    own = seen.only(nearest)
    between = Detections(pixels, covariance, own.size_px, own.contrast, own.edges)
    return joined((between, alone)), np.concatenate([owner[before], owner[exact]])


def _around(tracklets: Tracklets, time: float, reach: float) -> tuple[Float[Array, " N"], Index, Detections]:
    """Return times, tracklets and detections of the frames that have samples within ``reach`` (s) of ``time``.

    They are sorted by tracklet and time. Samples that are further away are not read from any tracklet.
    """
    low = int(np.searchsorted(tracklets.frame_times, time - reach - tracklets.rows_s[1]))
    high = int(np.searchsorted(tracklets.frame_times, time + reach - tracklets.rows_s[0]))
    low, high = max(low - 1, 0), min(high + 1, len(tracklets.frames))  # whatever the rounding of times
    seen = joined([tracklets.frames[number] for number in range(low, high)])
    owner = tracklets.owner[tracklets.starts[low] : tracklets.starts[max(high, low)]]
    counts = np.diff(tracklets.starts[low : high + 1])
    times = np.repeat(tracklets.frame_times[low:high], counts) + seen.pixels[:, 1] * tracklets.row_s
    order = np.lexsort((times, owner))
    return times[order], owner[order], seen.only(order)


def _lagrange(times: Float[Array, "N 4"], time: float, use: Array) -> Float[Array, "N 4"]:
    """Return the weights of samples at ``times`` for the value at ``time``, through those to ``use``."""
    weights = np.where(use, 1.0, 0.0)
    for one in range(4):
        for other in range(4):
            if other != one:
                apart = times[:, one] - times[:, other]
                factor = (time - times[:, other]) / np.where(apart == 0, 1.0, apart)
                weights[:, one] *= np.where(use[:, other] & (apart != 0), factor, 1.0)
    return np.asarray(weights)
