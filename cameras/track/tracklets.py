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


@dataclass(frozen=True, eq=False)
class Tracklets:
    """Samples of all tracklets of a camera, sorted by tracklet and time.

    Attributes:
        owner: [N], number of the tracklet.
        times: [N] (s), when the row of the detection was exposed, on the camera's clock.
        seen: the detections, N of them.
    """

    owner: Index
    times: Float[Array, " N"]
    seen: Detections


def join(frames: Sequence[Detections], frame_times: Float[Array, " F"], row_s: float) -> Tracklets:
    """Join detections of consecutive frames: each is sought where its velocity and that of its neighbours lead."""
    labels = [np.full(len(frame), -1) for frame in frames]
    velocity = [np.zeros((len(frame), 2)) for frame in frames]
    start = _calmest(frames)
    labels[start][:] = np.arange(len(frames[start]))
    names = len(frames[start])
    for direction in (1, -1):
        velocity[start][:] = 0.0
        last = len(frames) - 1 if direction > 0 else 0
        for at in range(start, last, direction):
            names = _step(frames, labels, velocity, (at, at + direction), names)
    owner = np.concatenate(labels).astype(int)
    whole = joined(frames)
    number = np.concatenate([np.full(len(frame), k) for k, frame in enumerate(frames)]).astype(int)
    times = frame_times[number] + whole.pixels[:, 1] * row_s
    order = np.lexsort((times, owner))
    return Tracklets(owner[order], times[order], whole.only(order))


def _calmest(frames: Sequence[Detections]) -> int:
    """Return the frame from which the detections move least to the next, among those that see most of them."""
    many = np.percentile([len(frame) for frame in frames], 70)
    best, least = 0, np.inf
    for number, (one, two) in enumerate(pairwise(frames)):
        if len(one) < max(many, 2) or len(two) < 2:
            continue
        moved = float(np.median(cKDTree(two.pixels).query(one.pixels)[0]))
        if moved < least:
            best, least = number, moved
    return best


def _step(
    frames: Sequence[Detections], labels: list[Array], velocity: list[Array], pair: tuple[int, int], names: int
) -> int:
    """Join the detections of the second frame of ``pair`` to those of the first; returns the count of tracklets."""
    here, there = pair
    one, two = frames[here], frames[there]
    if len(one) >= 2 and len(two) >= 1:
        expected = one.pixels + velocity[here]
        gate = _GATE * spacing(one.pixels)
        apart, index = cKDTree(two.pixels).query(expected)
        back = cKDTree(expected).query(two.pixels)[1]
        good = (apart < gate) & (back[index] == np.arange(len(one)))
        labels[there][index[good]] = labels[here][good]
        velocity[there][index[good]] = two.pixels[index[good]] - one.pixels[good]
    new = np.flatnonzero(labels[there] < 0)
    labels[there][new] = names + np.arange(len(new))
    known = np.flatnonzero(labels[there] < names)
    if len(new) and len(known) >= _NEIGHBOURS:
        near = cKDTree(two.pixels[known]).query(two.pixels[new], k=_NEIGHBOURS)[1]
        velocity[there][new] = np.median(velocity[there][known][near], axis=1)
    return names + len(new)


def at_time(tracklets: Tracklets, time: float, longest: float) -> Detections:
    """Return the detections at ``time`` (s, the camera's clock), by cubics through the two samples before and after.

    A tracklet is read if its samples around ``time`` are at most ``longest`` (s) apart. The covariance has that of the
    samples, and a tenth of the difference to a straight line between the nearest two for what a cubic cannot follow.
    """
    return owned_at_time(tracklets, time, longest)[0]


def owned_at_time(tracklets: Tracklets, time: float, longest: float) -> tuple[Detections, Index]:
    """Return the detections of ``at_time``, and the number [N] of the tracklet of each."""
    times, owner = tracklets.times, tracklets.owner
    before = np.flatnonzero((times[:-1] <= time) & (times[1:] > time) & (owner[:-1] == owner[1:]))
    before = before[times[before + 1] - times[before] <= longest]
    # The last sample of a tracklet, and one before a gap, can be read at their own time.
    exact = np.flatnonzero(np.abs(times - time) < _SAME * longest)
    exact = exact[~np.isin(owner[exact], owner[before])]
    alone = tracklets.seen.only(exact)
    if not len(before):
        return alone, owner[exact]
    around = before[:, None] + np.arange(-1, 3)
    index = np.clip(around, 0, len(times) - 1)
    inside = (owner[index] == owner[before][:, None]) & (index == around)  # each sample once
    gaps = np.abs(times[index] - time) < 3 * longest
    weights = _lagrange(times[index], time, inside & gaps)
    share = (time - times[before]) / (times[before + 1] - times[before])
    seen = tracklets.seen
    pixels = np.einsum("nk,nki->ni", weights, seen.pixels[index])
    straight = (1 - share)[:, None] * seen.pixels[before] + share[:, None] * seen.pixels[before + 1]
    covariance = np.einsum("nk,nkij->nij", weights**2, seen.covariance[index])
    covariance += ((0.1 * np.linalg.norm(pixels - straight, axis=1)) ** 2)[:, None, None] * np.eye(2)
    nearest = before + (share > 0.5)
    between = Detections(pixels, covariance, seen.size_px[nearest], seen.contrast[nearest])
    return joined((between, alone)), np.concatenate([owner[before], owner[exact]])


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
